// The chart of the last minute, in the time of the board: a lane for each digital input, a line for each analog point, and
// a mark for each event that the unit has reported.

import { level, share } from "/model.js";
import { channels, current } from "/board.js";
import { reading } from "/channels.js";
import * as events from "/events.js";
import { byId, drawing, element, setText } from "/ui.js";

const SPAN_MS = 60_000;
const WIDTH = 600;
const HEIGHT = 150;
/** Height of a lane, and the levels in it. */
const LANE = 20;
const [OFF, ON] = [16, 4];
/** Number of line colours in the style sheet: `--line-0` and so on. */
const COLORS = 4;
/** Number of events in words. */
const LISTED = 8;
/** The values of the points, each from its time on, and the time of the last state. */
let samples = [];
let now = 0;
/** Address in force, also after the power was switched off. */
let unit = null;

const keyOf = ({ id, channel }) => `${id} ${channel.kind}`;
const valueOf = ({ channel }) => level(channel) ?? share(channel);
const x = (at) => Math.max(0, WIDTH - ((now - at) / SPAN_MS) * WIDTH);
const inSeconds = (ms) => `${(ms / 1000).toFixed(3)} s`;

/** Clears the chart. */
export function reset() {
  samples = [];
  now = 0;
  unit = null;
  events.reset();
}

/** Adds a state of the board. */
export function add(state) {
  // The simulator has started again.
  if (state.virtual_ms < now) reset();
  now = state.virtual_ms;
  unit = state.address ?? unit;
  const values = new Map(channels(state).map((each) => [keyOf(each), valueOf(each)]));
  const last = samples.at(-1);
  const isNew = values.size !== last?.values.size || [...values].some(([key, value]) => last.values.get(key) !== value);
  // With --exact-line the time can stand still.
  if (isNew && last?.at === now) samples.pop();
  if (isNew) samples.push({ at: now, values });
  // The first one has the values at the beginning of the chart.
  while (samples.length > 1 && samples[1].at < now - SPAN_MS) samples.shift();
}

/** Adds the events in a frame. */
export const addFrame = (frame) => events.add(frame, unit);

/** Draws the chart. It stands still while the mouse is on a mark, whose text would not appear otherwise. */
export function draw() {
  if (current() === null || document.querySelector(".mark:hover")) return;
  const points = channels(current());
  const lanes = points.filter(({ channel }) => level(channel) !== null);
  const lines = points.filter(({ channel }) => share(channel) !== null);
  byId("chart-section").hidden = lanes.length + lines.length + events.recent().length === 0;
  setText(byId("chart-end"), `now, ${(now / 1000).toFixed(1)} s`);
  drawLanes(lanes);
  drawLines(lines);
  byId("events").replaceChildren(...events.recent().slice(-LISTED).reverse().map(({ at, words }) =>
    element("li", {}, element("span", { class: "when" }, inSeconds(at)), ` ${words}`)));
  byId("events-part").hidden = events.recent().length === 0;
}

function drawLanes(lanes) {
  const y = (n, value) => LANE * n + (value ? ON : OFF);
  const names = byId("lane-names");
  const chart = byId("lanes");
  const height = LANE * lanes.length;
  names.replaceChildren(...lanes.map(({ name }) => element("span", {}, name)));
  for (const part of [names, chart]) part.toggleAttribute("hidden", lanes.length === 0);
  chart.setAttribute("viewBox", `0 0 ${WIDTH} ${height}`);
  chart.style.height = `${names.clientHeight}px`;
  const levels = lanes.map((lane) => `${lane.name} ${valueOf(lane) ? "on" : "off"}`);
  chart.setAttribute("aria-label", `Levels of the digital inputs over the last minute. Now: ${levels.join(", ")}`);
  chart.replaceChildren(
    drawing("path", { class: "grid", d: `M150 0V${height}M300 0V${height}M450 0V${height}` }),
    ...lanes.map((lane, n) => drawing("polyline", { points: steps(lane, (value) => y(n, value)) })),
    ...marks(lanes, (n, event) => y(n, event.value)));
}

function drawLines(lines) {
  const y = (value) => HEIGHT * (1 - value);
  for (const id of ["scale", "analog"]) byId(id).toggleAttribute("hidden", lines.length === 0);
  byId("lines").replaceChildren(
    ...lines.map((each, n) => drawing("polyline", {
      points: steps(each, y), stroke: `var(--line-${n % COLORS})`,
      // Lines beyond the number of colours repeat a colour and are dashed.
      "stroke-dasharray": n >= COLORS && `${2 + Math.floor(n / COLORS) * 4} 4`,
    })),
    ...marks(lines, (n, event) => y(samples.findLast(({ at }) => at <= event.at)?.values.get(keyOf(lines[n])) ?? 0)));
  byId("legend").replaceChildren(...lines.map((each, n) => {
    const entry = element("span", { class: n < COLORS ? false : "dashed" }, `${each.name}: ${reading(each.id, each.channel)}`);
    entry.style.setProperty("--color", `var(--line-${n % COLORS})`);
    return entry;
  }));
}

/** Returns the corners of a point's line, which keeps each value until the next one. */
function steps(point, y) {
  const corners = [];
  let before = null;
  for (const { at, values } of samples.filter(({ values }) => values.has(keyOf(point)))) {
    const height = y(values.get(keyOf(point)));
    if (before !== null && before !== height) corners.push([x(at), before]);
    if (before !== height) corners.push([x(at), height]);
    before = height;
  }
  corners.push([WIDTH, before]);
  return corners.map(([at, height]) => `${at.toFixed(1)},${height.toFixed(1)}`).join(" ");
}

/** Makes the marks of the events of these points. `y` returns the height of the event of point `n`. */
function marks(points, y) {
  return events.recent().filter(({ at }) => at > now - SPAN_MS).flatMap((event) => {
    const n = points.findIndex(({ point }) => point !== undefined && point === event.point);
    if (n < 0) return [];
    const title = drawing("title", {}, `${inSeconds(event.at)} ${event.words}`);
    // The round end of a line of no length is a dot that is not stretched with the chart.
    return [drawing("path", { class: "mark", d: `M${x(event.at).toFixed(1)} ${y(n, event).toFixed(1)}h.01` }, title)];
  });
}
