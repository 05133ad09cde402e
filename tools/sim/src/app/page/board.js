// The board: power, switch, LEDs, line, and the slots with their modules.

import { address, pointName, slotsOf, terminalName, terminals } from "/model.js";
import { modules } from "/map.js";
import { post } from "/api.js";
import { buildChannel, showChannel } from "/channels.js";
import * as fixed from "/terminals.js";
import { byId, element, select, setText } from "/ui.js";

let shown = null;

/** The state that is shown; null before the first one. */
export const current = () => shown;

/** The channels of all slots and the terminals, each with its name, its point, and the id of a channel's element. */
export function channels(state) {
  const fixed = (state.terminals ?? []).map((terminal) => ({
    id: terminal.name, channel: terminal, name: terminalName(terminal), point: terminal.point,
  }));
  return fixed.concat(slotsOf(state).flatMap((slot, n) => slot.channels.map((channel, at) => ({
    id: idOf(n, at), channel, name: pointName(slot.port, at + 1), point: Number(address(slot.port, at + 1)),
  }))));
}

const idOf = (slot, at) => `c${slot}-${at + 1}`;
const redraw = () => shown && show(shown);

/** The part of a state whose change needs new elements: board type, ports and modules, terminals. */
const shape = (state) => JSON.stringify(
  [state.board, slotsOf(state).map((slot) => [slot.port, slot.module]), fixed.shape(state)]);

/** Shows a state. */
export function show(state) {
  const isNew = shown === null || shape(shown) !== shape(state);
  shown = state;
  if (isNew) byId("slots").replaceChildren(...(state.terminals ? fixed.build(state) : slotsOf(state).map(buildSlot)));
  // Without SW01 the address is that of register UNIT.
  byId("switch").hidden = Boolean(state.terminals);
  for (const id of ["unit-name", "unit"]) byId(id).hidden = !state.terminals;
  setText(byId("name"), state.board);
  document.title = `${state.board}, a virtual board`;
  byId("power").setAttribute("aria-checked", String(state.powered));
  setText(byId("power"), state.powered ? "Power is on" : "Power is off");
  byId("cycle").disabled = !state.powered;
  if (document.activeElement !== byId("dip-value")) byId("dip-value").value = state.dip;
  setText(byId("address"), addressText(state));
  setText(byId("unit"), String(state.address ?? "-"));
  byId("address").classList.toggle("differs", state.address !== state.dip);
  [...byId("dip").children].forEach((rocker, n) =>
    rocker.setAttribute("aria-checked", String((state.dip >> n) % 2 === 1)));
  for (const name of ["run", "fault", "activity"]) {
    byId(`led-${name}`).classList.toggle("lit", state.leds[name]);
    setText(byId(`led-${name}-text`), state.leds[name] ? "on" : "off");
    // A board with fixed inputs and outputs has one LED.
    byId(`led-${name}`).parentElement.hidden = name !== "run" && Boolean(state.terminals);
  }
  setText(byId("line-rate"), `${state.line.baud} bit/s`);
  setText(byId("line-format"), state.line.format);
  setText(byId("line-driver"), state.driver_enable ? "on" : "off");
  setText(byId("line-requests"), String(state.line.rx_frames));
  setText(byId("line-replies"), String(state.line.tx_frames));
  slotsOf(state).forEach((slot, n) => showSlot(slot, n, state.powered));
  fixed.show(state);
  byId("radio").hidden = !state.radio;
  if (state.radio) showRadio(state.radio);
  const log = byId("log");
  const text = state.log_tail.join("\n");
  if (log.textContent !== text) {
    log.textContent = text;
    log.scrollTop = log.scrollHeight;
  }
}

/** Forgets the state, before another board is shown. */
export function forget() {
  shown = null;
}

/** Connects the controls of the switch and the power. */
export function listen() {
  byId("power").addEventListener("click", () => post("power", () => ({ on: !shown.powered })));
  byId("cycle").addEventListener("click", () => post("power", { cycle: true }));
  byId("dip-value").addEventListener("change", async ({ target }) => {
    const value = target.valueAsNumber;
    const isSet = Number.isFinite(value) && await post("dip", { value }, target.ariaLabel);
    if (!isSet) target.value = shown.dip;
  });
  byId("dip-value").addEventListener("blur", redraw);
  for (let n = 0; n < 8; n += 1) byId("dip").append(rocker(n));
}

/** Returns the unit address in force as text. */
function addressText({ powered, address }) {
  if (!powered) return "none: the power is off";
  if (address === null) return "none: SW01 was no address at power-on";
  return address === 255 ? "255, recovery mode" : String(address);
}

/** Makes one of the eight positions of SW01; `n` counts from 0. */
function rocker(n) {
  const set = (on) => post("dip", () => ({ value: on ? shown.dip | (1 << n) : shown.dip & ~(1 << n) }));
  return element("button", {
    type: "button", role: "switch", "aria-checked": "false", "aria-label": `SW01 position ${n + 1}, adds ${1 << n}`,
    onclick: () => post("dip", () => ({ value: shown.dip ^ (1 << n) })),
    onkeydown: (event) => {
      const { key, currentTarget } = event;
      if (key === "ArrowUp" || key === "ArrowDown") set(key === "ArrowUp");
      else if (key === "ArrowRight") currentTarget.nextElementSibling?.focus();
      else if (key === "ArrowLeft") currentTarget.previousElementSibling?.focus();
      else return;
      event.preventDefault();
    },
  }, element("span", {}, String(n + 1)));
}

function buildSlot(slot, n) {
  const title = `Port ${slot.port}`;
  const made = slot.channels.map((channel, at) => buildChannel(slot, idOf(n, at), channel, at + 1, redraw));
  return element("div", { class: `slot m-${slot.module}`, role: "group", "aria-label": title },
    element("header", {},
      element("h3", {}, title),
      select({
        id: `module-${n}`, "aria-label": `Module in ${title}`,
        onchange: (event) => post(`${slot.path}module`, { name: event.target.value }),
      }, modules.map(([name, about]) => [name, `${name}: ${about}`]))),
    element("p", { class: "mismatch", id: `mismatch-${n}` }),
    element("div", { class: "channels" }, ...made.filter(Boolean)),
    element("ol", { class: "terminals", "aria-label": `Screw terminals of ${title}` },
      ...terminals(slot.module).map((label) => element("li", {}, element("span", {}, label)))));
}

/** Shows the LoRa module. */
function showRadio(radio) {
  setText(byId("radio-mode"), radio.mode ?? "off or starting");
  setText(byId("radio-aux"), radio.aux ? "high, idle" : "low, busy");
  setText(byId("radio-channel"), `${radio.channel_mhz} MHz`);
  setText(byId("radio-address"), String(radio.address));
  setText(byId("radio-rate"), `${radio.air_rate / 1000} kbit/s`);
  setText(byId("radio-power"), `${radio.power_dbm} dBm`);
  setText(byId("radio-sent"), `${radio.packets_sent} packets`);
  setText(byId("radio-received"), `${radio.packets_received} packets`);
}

function showSlot(slot, n, powered) {
  const module = byId(`module-${n}`);
  module.value = slot.module;
  module.disabled = powered;
  const mismatch = byId(`mismatch-${n}`);
  mismatch.hidden = slot.configured === slot.module;
  setText(mismatch, `configured ${slot.configured}, plugged ${slot.module}`);
  module.title = powered ? "Switch the power off to change the module" : "";
  slot.channels.forEach((channel, at) => showChannel(idOf(n, at), channel));
}
