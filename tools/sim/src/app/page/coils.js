// The coils of the outputs, which are what masters and links want, beside their lamps, which are the terminals. The page
// reads them only while the user asks for it, because each request keeps a unit with COMM_TIMEOUT from noticing that its
// master is gone.

import { portOf } from "/model.js";
import * as modbus from "/modbus.js";
import { byId, element, setText } from "/ui.js";

const READ_MS = 1000;

/** The coils that were read, by their address: whether coil and lamp were on. */
const coils = new Map();
let isReading = false;

/** Makes the element behind the lamp of an output that has its coil where the two differ. */
export const note = (point) => element("p", { class: "pin", "data-coil": point });

const notes = () => [...document.querySelectorAll("[data-coil]")];
const addressOf = (each) => Number(each.dataset.coil);
const isLit = (each) => each.previousElementSibling.getAttribute("aria-checked") === "true";

/** Shows the coils that differ. One that was read before its lamp changed is old. */
export function show() {
  const outputs = notes();
  byId("coils-part").hidden = outputs.length === 0;
  for (const each of outputs) {
    const read = coils.get(addressOf(each));
    const isNow = read?.lit === isLit(each);
    setText(each, isNow && read.coil !== read.lit ? `coil ${read.coil ? "on" : "off"}` : "");
  }
}

/** Forgets the coils, before those of another board are shown. */
export function forget() {
  coils.clear();
  byId("coils").checked = false;
}

async function readAll() {
  const outputs = notes();
  const before = outputs.map(addressOf);
  // The outputs of a port have consecutive addresses.
  for (const port of Object.values(Object.groupBy(outputs, (each) => portOf(addressOf(each))))) {
    const first = addressOf(port[0]);
    const bits = await modbus.readCoils(first, port.length, "Coils");
    // The user may have chosen another board meanwhile.
    if (!byId("coils").checked || String(notes().map(addressOf)) !== String(before)) return;
    if (bits === null) {
      byId("coils").checked = false;
      break;
    }
    port.forEach((each, n) => coils.set(first + n, { coil: bits[n], lit: isLit(each) }));
  }
  show();
}

/** Reads the coils, and does so again while the user asks for it. */
async function update() {
  if (isReading || !byId("coils").checked) return;
  isReading = true;
  await readAll().finally(() => { isReading = false; });
}

/** Connects the check box. */
export function listen() {
  byId("coils").addEventListener("change", () => {
    coils.clear();
    show();
    update();
  });
  setInterval(update, READ_MS);
}
