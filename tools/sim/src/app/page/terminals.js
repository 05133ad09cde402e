// The terminals of a board with fixed inputs and outputs: their controls and displays, in the order on the board.

import { note } from "/coils.js";
import { post, stream, isStreaming } from "/api.js";
import { address, numberOf, pointName, portOf } from "/model.js";
import { byId, element, setText } from "/ui.js";

/** The groups of a board, each with its kinds of terminals. */
const GROUPS = [
  ["Digital inputs", ["input"]],
  ["Relays", ["relay"]],
  ["Analog inputs", ["voltage", "current"]],
  ["Analog outputs", ["output"]],
  ["On the board", ["switch", "supply", "potentiometer"]],
];

/** Kinds with two states: the entry of the state, and the texts of both states. */
const SWITCHES = {
  input: { key: "energised", on: "24 V", off: "open" },
  relay: { key: "energised", on: "energised", off: "released" },
  switch: { key: "high", on: "pin high", off: "pin low" },
  supply: { key: "present", on: "24 V", off: "missing" },
};

/** Kinds with a slider: the entry of the state, its largest value on the slider, and its unit with the number of entries
 * in a unit. */
const SLIDERS = {
  voltage: { key: "millivolts", most: 10_000, unit: "V", scale: 1000 },
  current: { key: "microamperes", most: 20_000, unit: "mA", scale: 1000 },
  potentiometer: { key: "permille", most: 1000, unit: "%", scale: 10 },
};

const idOf = (name) => `t-${name}`;
const pathOf = (name) => `terminals/${encodeURIComponent(name)}`;

/** The part of the terminals whose change needs new elements. */
export const shape = (state) => (state.terminals ?? []).map(({ name, point }) => [name, point]);

/** Makes the elements of all groups that the board has. */
export function build(state) {
  const groups = GROUPS.map(([title, kinds]) => [title, state.terminals.filter(({ kind }) => kinds.includes(kind))]);
  return groups.filter(([, members]) => members.length > 0).map(([title, members]) =>
    element("div", { class: "slot fixed", role: "group", "aria-label": title },
      element("header", {}, element("h3", {}, title)),
      element("div", { class: "channels" }, ...members.map(buildTerminal))));
}

function buildTerminal({ name, kind, point }) {
  const labels = [element("span", {}, name)];
  if (point !== undefined) {
    const [port, number] = [portOf(point), numberOf(point)];
    labels.push(element("code", {}, pointName(port, number)), element("code", {}, address(port, number)));
  }
  return element("div", { class: `channel ${kind}`, role: "group", "aria-label": `Terminal ${name}` },
    element("div", { class: "name" }, ...labels), ...control(name, kind, point));
}

function control(name, kind, point) {
  const id = idOf(name);
  if (kind === "relay") {
    return [element("div", {
      id, class: "lamp", role: "switch", "aria-readonly": "true", "aria-checked": "false", "aria-label": `Relay ${name}`,
    }), note(point)];
  }
  if (kind === "output") return [element("span", { id, class: "reading" })];
  if (kind in SLIDERS) {
    const { key, most } = SLIDERS[kind];
    return [
      element("span", { id: `${id}-text`, class: "reading" }),
      element("input", {
        type: "range", id, min: 0, max: most, step: most / 1000, "aria-label": `Slider of ${name}`,
        oninput: (event) => stream(pathOf(name), { [key]: Number(event.target.value) }),
      }),
    ];
  }
  const { key } = SWITCHES[kind];
  const button = element("button", {
    id, type: "button", role: "switch", "aria-checked": "false", "aria-label": name, class: "toggle",
    onclick: () => post(pathOf(name), () => ({ [key]: button.getAttribute("aria-checked") !== "true" }), name),
  });
  return [button];
}

/** Shows the states of all terminals. */
export function show(state) {
  for (const terminal of state.terminals ?? []) showTerminal(terminal);
}

function showTerminal(terminal) {
  const { name, kind } = terminal;
  const node = byId(idOf(name));
  if (kind === "output") {
    setText(node, `${(terminal.millivolts / 1000).toFixed(2)} V`);
  } else if (kind in SLIDERS) {
    const { key, unit, scale } = SLIDERS[kind];
    const text = `${terminal[key] / scale} ${unit}`;
    if (!isStreaming(pathOf(name))) node.value = terminal[key];
    node.setAttribute("aria-valuetext", text);
    setText(byId(`${idOf(name)}-text`), text);
  } else {
    const { key, on, off } = SWITCHES[kind];
    node.setAttribute("aria-checked", String(terminal[key]));
    setText(node, terminal[key] ? on : off);
  }
}
