// The chart of the analog points over the last minute.

import { share } from "/model.js";
import { channels } from "/board.js";
import { reading } from "/channels.js";
import { byId, element } from "/ui.js";

const SPAN_MS = 60_000;
const WIDTH = 600;
const HEIGHT = 150;
/** Number of line colours in the style sheet: `--line-0` and so on. */
const COLORS = 4;
let samples = [];

/** Clears the chart. */
export function reset() {
  samples = [];
}

/** Adds a sample of the board, and draws the samples of the last minute. */
export function sample(state) {
  const analog = channels(state).filter(({ channel }) => share(channel) !== null);
  byId("chart-section").hidden = analog.length === 0;
  if (analog.length === 0) {
    reset();
    return;
  }
  const now = performance.now();
  samples = samples.filter((each) => each.at > now - SPAN_MS);
  samples.push({ at: now, shares: new Map(analog.map(({ id, channel }) => [id, share(channel)])) });
  byId("lines").replaceChildren(...analog.map(({ id }, n) => line(id, n, now)));
  byId("legend").replaceChildren(...analog.map((each, n) => {
    const entry = element("span", { class: n < COLORS ? false : "dashed" }, `${each.name}: ${reading(each.id, each.channel)}`);
    entry.style.setProperty("--color", `var(--line-${n % COLORS})`);
    return entry;
  }));
}

function line(id, n, now) {
  const points = samples.filter((each) => each.shares.has(id)).map((each) => {
    const x = WIDTH - ((now - each.at) / SPAN_MS) * WIDTH;
    const y = HEIGHT - each.shares.get(id) * HEIGHT;
    return `${x.toFixed(1)},${y.toFixed(1)}`;
  });
  const made = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  made.setAttribute("points", points.join(" "));
  made.style.stroke = `var(--line-${n % COLORS})`;
  // Lines beyond the number of colours repeat a colour and are dashed.
  if (n >= COLORS) made.setAttribute("stroke-dasharray", `${2 + Math.floor(n / COLORS) * 4} 4`);
  return made;
}
