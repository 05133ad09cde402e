// The log of the frames on the line.

import { isAnswered, isShown, spaced } from "/model.js";
import { get } from "/api.js";
import { byId, element, setText } from "/ui.js";

/** Number of frames that the page keeps. */
const KEPT = 500;
/** Time after which a request without a reply is marked. */
const PATIENCE_MS = 1000;
let frames = [];
/** Number of the last frames that have no row yet. */
let waiting = 0;
let last = null;
/** Frames that have arrived while the earlier ones are fetched. */
let held = null;
/** The last request, and its row, while it has no reply. */
let open = null;
/** The log was cleared while the earlier frames are fetched, so they are not wanted any more. */
let unwanted = false;
/** Called with each frame. */
let whenAdded = () => {};
/** Called when the simulator has started again, before its first frame. */
let whenRestarted = () => {};

const milliseconds = (us) => (us === null ? "" : (us / 1000).toFixed(2));

function row(frame) {
  const good = frame.crc_ok && !frame.damaged;
  const fromMaster = frame.direction === "rx";
  const cell = (kind, text) => element("td", { role: "cell", class: kind }, text);
  const made = element("tr", { role: "row", class: `${fromMaster ? "master" : "unit"}${good ? "" : " bad"}` },
    cell("time number", (frame.start_us / 1e6).toFixed(3)),
    cell("gap number", milliseconds(frame.gap_us)),
    cell("turnaround number", milliseconds(frame.turnaround_us)),
    cell("silence number", fromMaster ? "" : frame.silence_us.toFixed(1)),
    cell("from", fromMaster ? "master" : "unit"),
    cell("bytes", spaced(frame.bytes)),
    cell("meaning", frame.summary));
  made.hidden = !isShown(frame, byId("filter").value);
  follow(frame, made);
  return made;
}

/** Marks the last request when another request follows, or when it has no reply for a while. */
function follow(frame, made) {
  if (frame.direction === "tx") {
    open?.classList.remove("unanswered");
    open = null;
    return;
  }
  open?.classList.add("unanswered");
  open = isAnswered(frame) ? made : null;
  const request = open;
  setTimeout(() => {
    if (request !== null && request === open) request.classList.add("unanswered");
  }, PATIENCE_MS);
}

/** Adds a frame that was on the line. */
export function add(frame) {
  if (held === null) {
    append(frame);
  } else {
    held.push(frame);
    if (held.length > KEPT) held.shift();
  }
}

function append(frame) {
  if (last !== null && frame.number <= last.number) return;
  last = frame;
  whenAdded(frame);
  frames.push(frame);
  if (frames.length > KEPT) frames.shift();
  // A hidden page gets no animation frame. It draws nothing, and at most KEPT frames wait for their rows.
  if (waiting === 0) requestAnimationFrame(draw);
  waiting = Math.min(waiting + 1, KEPT);
}

function draw() {
  const body = byId("frames");
  body.append(...frames.slice(Math.max(0, frames.length - waiting)).map(row));
  waiting = 0;
  while (body.children.length > frames.length) body.firstElementChild.remove();
  count();
  if (byId("follow").checked) {
    const scroll = byId("frame-scroll");
    scroll.scrollTop = scroll.scrollHeight;
  }
}

function count() {
  const hidden = byId("frames").querySelectorAll("tr[hidden]").length;
  setText(byId("frame-count"), hidden > 0 ? `${frames.length - hidden} of ${frames.length} frames` : `${frames.length} frames`);
}

function filter() {
  const words = byId("filter").value;
  const rows = byId("frames").children;
  frames.slice(0, rows.length).forEach((frame, n) => {
    rows[n].hidden = !isShown(frame, words);
  });
  count();
}

function clear() {
  if (held !== null) {
    held = [];
    unwanted = true;
  }
  frames = [];
  waiting = 0;
  byId("frames").replaceChildren();
  count();
}

/** Adds those of all frames of the simulator that are missing. After a new start of the simulator its frames are numbered
 * from 1 again, so the last frame is missing or has another start. */
function addMissing(all) {
  const hasRestarted = last !== null && !all.some((frame) => frame.number > last.number
    || (frame.number === last.number && frame.start_us === last.start_us));
  if (hasRestarted) {
    last = null;
    clear();
    whenRestarted();
  }
  all.slice(-KEPT).forEach(append);
}

/** Whether new frames are held until the simulator has answered. */
export const isHolding = () => held !== null;

/** Fetches the frames since the last one. Until the simulator has answered, it is not known whether it has started again, so
 * new frames wait. */
export async function fetchMissed() {
  held ??= [];
  const answer = await get("/api/frames").catch(() => null);
  if (answer === null) return;
  if (unwanted) {
    const since = held?.[0]?.number ?? Infinity;
    const cleared = answer.frames.filter((frame) => frame.number < since);
    last = cleared.at(-1) ?? last;
  } else {
    addMissing(answer.frames);
  }
  const arrived = held ?? [];
  held = null;
  unwanted = false;
  arrived.forEach(append);
}

/** Connects the filter and the button that clears the log. Sets the functions that are called with each frame, and when
 * the simulator has started again. */
export function listen(added, restarted) {
  [whenAdded, whenRestarted] = [added, restarted];
  byId("filter").addEventListener("input", filter);
  byId("clear").addEventListener("click", clear);
}
