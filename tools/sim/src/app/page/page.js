// The page: shows the state of the board, and sends the user's changes to the simulator.

import * as api from "/api.js";
import * as board from "/board.js";
import * as boards from "/boards.js";
import * as chart from "/chart.js";
import * as coils from "/coils.js";
import * as connect from "/connect.js";
import * as faults from "/faults.js";
import * as frames from "/frames.js";
import * as links from "/links.js";
import { byId, element, setText } from "/ui.js";

const DRAW_MS = 250;
const POLL_MS = 2000;
const FINDINGS_SHOWN = 50;

let events = null;

/** Shows the first state of a stream. The simulator may have started again since the last one. */
function begin(state) {
  show(state);
  connect.fetchEndpoints();
  frames.fetchMissed();
}

/** Shows a later state. Drops a state that is older than the one shown. */
function take(state) {
  if (state.virtual_ms >= (board.current()?.virtual_ms ?? 0)) show(state);
}

function show(state) {
  board.show(state);
  chart.add(state);
  connect.show(state);
  links.show(state);
  coils.show();
}

/** Shows whether the simulator answers. Without it the board cannot be operated. */
function setOnline(isOnline) {
  const text = "OFFLINE: the simulator does not answer. The page shows its last state and tries again.";
  setText(byId("connection"), isOnline ? "live" : text);
  document.body.classList.toggle("offline", !isOnline);
  byId("board").inert = !isOnline;
  byId("faults").inert = !isOnline;
  // The next state sets the title again.
  if (!isOnline) document.title = `OFFLINE: ${byId("name").textContent}`;
}

function listen() {
  events?.close();
  events = new EventSource(api.path("events"));
  let isFirst = true;
  events.addEventListener("open", () => {
    isFirst = true;
    setOnline(true);
    poll();
  });
  events.addEventListener("error", () => {
    setOnline(false);
    // The browser tries again after a lost connection, but not after a refusal.
    if (events.readyState === EventSource.CLOSED) setTimeout(listen, POLL_MS);
  });
  events.addEventListener("state", (event) => {
    (isFirst ? begin : take)(JSON.parse(event.data));
    isFirst = false;
  });
  events.addEventListener("frame", (event) => frames.add(JSON.parse(event.data)));
  events.addEventListener("lost", () => frames.fetchMissed());
}

async function fetchFindings() {
  const { findings } = await api.get(api.path("findings"));
  const items = findings.slice(-FINDINGS_SHOWN).map((each) => element("li", {},
    element("span", { class: "when" }, `${(each.at_us / 1e6).toFixed(3)} s, pc ${each.pc}`),
    `${each.what}${each.count > 1 ? ` (${each.count} times)` : ""}`));
  byId("findings").replaceChildren(...(items.length > 0 ? items : [element("li", {}, "none")]));
}

/** Reads the boards, the findings and the faults, which are in no event, and again the frames and the endpoints if the answer
 * was lost. */
function poll() {
  boards.refresh(choose).catch(() => {});
  fetchFindings().catch(() => {});
  if (frames.isHolding()) frames.fetchMissed();
  if (!connect.isKnown()) connect.fetchEndpoints();
  if (!byId("faults-section").hidden) faults.refresh();
}

/** Shows another board of the line. */
function choose(name) {
  api.chooseBoard(name);
  board.forget();
  chart.reset();
  links.forget();
  coils.forget();
  listen();
  faults.refresh();
}

api.onChange(take);
board.listen();
frames.listen(chart.addFrame, () => {
  chart.reset();
  chart.add(board.current());
});
links.listen();
coils.listen();
setInterval(chart.draw, DRAW_MS);
setInterval(poll, POLL_MS);
faults.refresh();
listen();
