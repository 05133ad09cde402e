// The front panel: shows the state of the board, and asks the simulator for what a person does to it.

import * as api from "/api.js";
import * as board from "/board.js";
import * as chart from "/chart.js";
import * as faults from "/faults.js";
import * as frames from "/frames.js";
import { byId, element, select, setText } from "/ui.js";

const SAMPLE_MS = 250;
const POLL_MS = 2000;
const FINDINGS_SHOWN = 50;

let events = null;

/** The first state of a stream, which may come from a simulator that has started again. */
function begin(state) {
  board.show(state);
  frames.fetchMissed().then((isOther) => {
    if (isOther) chart.reset();
  }).catch(() => {});
}

/** A later state. One that was under way while a newer one was shown is dropped. */
function take(state) {
  if (state.virtual_ms >= (board.current()?.virtual_ms ?? 0)) board.show(state);
}

function listen() {
  events?.close();
  events = new EventSource(api.path("events"));
  let isFirst = true;
  events.addEventListener("open", () => {
    isFirst = true;
    setText(byId("connection"), "live");
    poll();
  });
  events.addEventListener("error", () => {
    setText(byId("connection"), "the simulator does not answer; trying again");
    // A refusal, unlike a lost connection, is not tried again by the browser.
    if (events.readyState === EventSource.CLOSED) setTimeout(listen, POLL_MS);
  });
  events.addEventListener("state", (event) => {
    (isFirst ? begin : take)(JSON.parse(event.data));
    isFirst = false;
  });
  events.addEventListener("frame", (event) => frames.add(JSON.parse(event.data)));
  events.addEventListener("lost", () => frames.fetchMissed().catch(() => {}));
}

async function fetchFindings() {
  const { findings } = await api.get(api.path("findings"));
  const items = findings.slice(-FINDINGS_SHOWN).map((each) => element("li", {},
    element("span", { class: "when" }, `${(each.at_us / 1e6).toFixed(3)} s, pc ${each.pc}`),
    `${each.what}${each.count > 1 ? ` (${each.count} times)` : ""}`));
  byId("findings").replaceChildren(...(items.length > 0 ? items : [element("li", {}, "none")]));
}

/** What no event tells: findings and faults. */
function poll() {
  fetchFindings().catch(() => {});
  if (!byId("faults-section").hidden) faults.refresh();
}

/** Lets a person choose a board where there are several on the line. */
async function offerBoards() {
  const boards = await api.get("/api/boards");
  if (boards === null || boards.length < 2) return;
  const choice = select({
    id: "boards",
    onchange: (event) => {
      api.chooseBoard(event.target.value);
      board.forget();
      chart.reset();
      listen();
      faults.refresh();
    },
  }, boards.map(({ name, board: kind }) => [name, `${name} (${kind})`]));
  byId("chooser").append("Board ", choice);
  byId("chooser").hidden = false;
}

api.onChange(take);
board.listen();
frames.listen();
setInterval(() => board.current() && chart.sample(board.current()), SAMPLE_MS);
setInterval(poll, POLL_MS);
offerBoards().catch(() => {});
faults.refresh();
listen();
