// The channels of a module: their controls and displays.

import { inputs, outputs, address, pointName } from "/model.js";
import { note } from "/coils.js";
import { post, stream, isStreaming } from "/api.js";
import { byId, element, select, setText } from "/ui.js";

/** The chosen range of each analog channel. */
const rangeOf = new Map();
const inputRange = (id) => inputs[rangeOf.get(id) ?? "volts"];
const outputRange = (id) => outputs[rangeOf.get(id) ?? "volts"];

const NAMES = { di: "DI", do: "DO", relay: "Relay", ai: "AI", ao: "AO" };

/** Makes the element of a channel. `id` is unique on the page; `redraw` shows the board again. */
export function buildChannel(slot, id, channel, number, redraw) {
  const name = NAMES[channel.kind];
  if (name === undefined) return null;
  // A relay has two points: its jumper, and its coil with a number that is two higher.
  const at = channel.kind === "relay" ? number + 2 : number;
  const point = pointName(slot.port, at);
  const coil = Number(address(slot.port, at));
  return element("div", { class: `channel ${channel.kind}`, role: "group", "aria-label": `${name} ${point}` },
    element("div", { class: "name" },
      element("span", {}, `${name} ${number}`), element("code", {}, point), element("code", {}, address(slot.port, at))),
    ...control(slot, id, channel.kind, number, point, coil, redraw));
}

function control(slot, id, kind, number, point, coil, redraw) {
  const path = `${slot.path}channels/${number}`;
  const toggle = (key, label) => {
    const button = element("button", {
      id, type: "button", role: "switch", "aria-checked": "false", "aria-label": label, class: "toggle",
      onclick: () => post(path, () => ({ [key]: button.getAttribute("aria-checked") !== "true" }), label),
    });
    return button;
  };
  const lamp = (label) => element("div", {
    id: `${id}-lamp`, class: "lamp", role: "switch", "aria-readonly": "true", "aria-checked": "false", "aria-label": label,
  });
  switch (kind) {
    case "di":
      return [toggle("energised", `Digital input ${point}`)];
    case "do":
      return [lamp(`Digital output ${point}`), note(coil)];
    case "relay":
      return [
        lamp(`Coil of relay ${number}, ${point}`),
        note(coil),
        toggle("manual", `Manual jumper of relay ${number}, ${pointName(slot.port, number)}`),
      ];
    case "ai":
      return analogInput(path, id, point, redraw);
    default:
      return analogOutput(id, point, redraw);
  }
}

function analogInput(path, id, point, redraw) {
  const label = `Analog input ${point}`;
  const field = element("input", {
    type: "number", id: `${id}-number`, step: "any", "aria-label": label,
    onchange: () => {
      const millivolts = inputRange(id).toPin(field.valueAsNumber);
      const isNumber = Number.isFinite(millivolts);
      field.value = inputRange(id).fromPin(isNumber ? millivolts : slider.valueAsNumber);
      if (isNumber) post(path, { millivolts }, label);
    },
    onblur: redraw,
  });
  const range = rangeOfChannel(id, `Range of analog input ${point}`, inputs, redraw);
  const slider = element("input", {
    type: "range", id, min: 0, max: 3300, step: 1, "aria-label": `Slider of analog input ${point}`, "data-path": path,
    oninput: (event) => stream(path, { millivolts: Number(event.target.value) }).then(redraw),
  });
  return [element("div", { class: "value" }, field, range), slider, element("p", { class: "pin", id: `${id}-text` })];
}

/** Makes the drop-down list of an analog channel's ranges. */
function rangeOfChannel(id, label, ranges, redraw) {
  const range = select({
    id: `${id}-range`, "aria-label": label,
    onchange: (event) => {
      rangeOf.set(id, event.target.value);
      redraw();
    },
  }, Object.entries(ranges).map(([key, each]) => [key, each.unit]));
  range.value = rangeOf.get(id) ?? "volts";
  return range;
}

function analogOutput(id, point, redraw) {
  const range = rangeOfChannel(id, `Jumper of analog output ${point}`, outputs, redraw);
  const meter = element("meter", { id: `${id}-meter`, min: 0, max: 4095, "aria-label": `Analog output ${point}` });
  return [
    element("div", { class: "value" }, element("span", { class: "reading", id: `${id}-value` }), range),
    meter,
    element("p", { class: "pin", id: `${id}-text` }),
  ];
}

/** Shows the state of a channel. */
export function showChannel(id, channel) {
  switch (channel.kind) {
    case "di":
      showSwitch(id, channel.energised, channel.energised ? "24 V" : "open");
      break;
    case "do":
      showSwitch(`${id}-lamp`, channel.on, channel.on ? "conducts" : "off");
      break;
    case "relay":
      showSwitch(`${id}-lamp`, channel.energised, channel.energised ? "energised" : "released");
      showSwitch(id, channel.manual, channel.manual ? "jumper: manual" : "jumper: automatic");
      break;
    case "ai":
      showInput(id, channel.millivolts);
      break;
    case "ao":
      byId(`${id}-meter`).value = channel.code;
      setText(byId(`${id}-value`), outputRange(id).fromCode(channel.code));
      setText(byId(`${id}-text`), `code ${channel.code} of 4095`);
      break;
    default:
  }
}

function showSwitch(id, on, text) {
  byId(id).setAttribute("aria-checked", String(on));
  setText(byId(id), text);
}

function showInput(id, millivolts) {
  const { fromPin, unit } = inputRange(id);
  const slider = byId(id);
  const field = byId(`${id}-number`);
  // Do not overwrite a value that the user is typing or dragging.
  if (document.activeElement !== field) field.value = fromPin(millivolts);
  if (!isStreaming(slider.dataset.path)) slider.value = millivolts;
  slider.setAttribute("aria-valuetext", `${fromPin(millivolts)} ${unit}, ${millivolts} mV at the pin`);
  setText(byId(`${id}-text`), `pin: ${millivolts} mV`);
}

/** Returns an analog channel's value in its range, as text; null for any other channel. */
export function reading(id, channel) {
  if (channel.kind === "ai") return `${inputRange(id).fromPin(channel.millivolts)} ${inputRange(id).unit}`;
  if (channel.kind === "ao") return `${outputRange(id).fromCode(channel.code)} ${outputRange(id).unit}`;
  return null;
}
