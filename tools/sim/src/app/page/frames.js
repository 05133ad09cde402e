// The log of the frames on the line.

import { isShown, spaced } from "/model.js";
import { get } from "/api.js";
import { byId, element, setText } from "/ui.js";

const KEPT = 500;
let frames = [];
/** How many of the last frames have no row yet. */
let waiting = 0;
let last = null;

const milliseconds = (us) => (us === null ? "" : (us / 1000).toFixed(2));

function row(frame) {
  const good = frame.crc_ok && !frame.damaged;
  const fromMaster = frame.direction === "rx";
  const cell = (kind, text) => element("td", { role: "cell", class: kind }, text);
  const made = element("tr", { role: "row", class: `${fromMaster ? "master" : "unit"}${good ? "" : " bad"}` },
    cell("time number", (frame.start_us / 1e6).toFixed(3)),
    cell("gap number", milliseconds(frame.gap_us)),
    cell("turnaround number", milliseconds(frame.turnaround_us)),
    cell("from", fromMaster ? "master" : "unit"),
    cell("bytes", spaced(frame.bytes)),
    cell("meaning", frame.summary));
  made.hidden = !isShown(frame, byId("filter").value);
  return made;
}

/** Takes a frame that was on the line. */
export function add(frame) {
  if (last !== null && frame.number <= last.number) return;
  last = frame;
  frames.push(frame);
  if (frames.length > KEPT) frames.shift();
  // A page that nobody looks at draws nothing, and keeps no more than it will draw.
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
  frames = [];
  waiting = 0;
  byId("frames").replaceChildren();
  count();
}

/** Fetches what was on the line since the last frame. Returns whether the simulator is another one than before: one that
 * has started again counts from one, and knows the last frame not at all or another one by its number. */
export async function fetchMissed() {
  const answer = await get("/api/frames");
  if (answer === null) return false;
  const all = answer.frames;
  const isOther = last !== null && !all.some((frame) => frame.number > last.number
    || (frame.number === last.number && frame.start_us === last.start_us));
  if (isOther) {
    last = null;
    clear();
  }
  all.slice(-KEPT).forEach(add);
  return isOther;
}

/** Connects filter and buttons. */
export function listen() {
  byId("filter").addEventListener("input", filter);
  byId("clear").addEventListener("click", clear);
}
