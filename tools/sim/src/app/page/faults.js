// The panel of the faults that the user causes on the line and on the board.

import { get, path, send } from "/api.js";
import { byId, element } from "/ui.js";

const LABELS = {
  bit_error_rate: "Bit errors, share of bits",
  drop_rate: "Lost bytes, share of bytes",
  noise_hz: "Noise on the line, pulses per second",
  radio_loss: "Lost radio packets, share of packets",
  i2c_absent: "DAC does not answer on I2C",
  hse_failed: "Crystal has failed",
  hsi_percent: "HSI deviation from 8 MHz, percent",
  lsi_khz: "LSI, kHz",
};

const idOf = (key) => `fault-${key}`;

function control(key, value) {
  const label = LABELS[key] ?? key.replaceAll("_", " ");
  const set = (wanted) => change({ [key]: wanted }, label);
  if (typeof value === "boolean") {
    const box = element("input", { id: idOf(key), type: "checkbox", onchange: (event) => set(event.target.checked) });
    return element("label", { class: "check" }, box, label);
  }
  const field = element("input", {
    id: idOf(key), type: "number", step: "any",
    onchange: (event) => {
      const wanted = event.target.valueAsNumber;
      if (Number.isFinite(wanted)) set(wanted);
      else refresh(true);
    },
    onblur: () => refresh(),
  });
  return element("label", {}, field, label);
}

/** Shows the faults. Without `all`, the field in which the user is typing keeps its value. */
function show(faults, all) {
  const known = Object.entries(faults).filter(([, value]) => ["boolean", "number"].includes(typeof value));
  const list = byId("faults");
  const keys = known.map(([key]) => key).join();
  if (list.dataset.keys !== keys) {
    list.dataset.keys = keys;
    list.replaceChildren(...known.map(([key, value]) => control(key, value)));
  }
  for (const [key, value] of known) {
    const field = byId(idOf(key));
    if (typeof value === "boolean") field.checked = value;
    else if (all || document.activeElement !== field) field.value = value;
  }
}

/** Number of changes so far. A reply to a request that was sent before the last change is out of date. */
let changes = 0;

async function change(wanted, label) {
  changes += 1;
  const isSet = await send(path("faults"), wanted, label) !== null;
  await refresh(!isSet);
}

/** Reads and shows the faults. Hides the panel if the simulator does not offer faults. Without `all`, the field in
 * which the user is typing keeps its value. */
export async function refresh(all = false) {
  const before = changes;
  const faults = await get(path("faults")).catch(() => null);
  if (before !== changes) return;
  byId("faults-section").hidden = faults === null;
  if (faults !== null) show(faults, all);
}
