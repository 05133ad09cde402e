// The meaning of values, independent of the page's elements.

/** Full scale at the pin of an analog input, in mV. */
const PIN_MV = 3300;
/** Full scale of a DAC. */
const LARGEST_CODE = 4095;
/** 0 degrees Celsius in kelvin. */
const KELVIN = 273.15;
/** The firmware's default thermistor: 10 kOhm at 25 degrees Celsius, B = 3950 K, with a pull-up of 10 kOhm. */
const BETA = 3950;
const T0 = 25 + KELVIN;

const within = (millivolts) => Math.min(PIN_MV, Math.max(0, Math.round(millivolts)));
const rounded = (value, digits) => Number(value.toFixed(digits));

/** A range in which the value `full` is full scale at the pin: 10 V or 20 mA (docs/wiring.md). */
const linear = (unit, full) => ({
  unit,
  fromPin: (millivolts) => rounded((millivolts * full) / PIN_MV, 3),
  toPin: (value) => within((value * PIN_MV) / full),
});

/** The ranges of an analog input, each with its conversion from and to millivolts at the pin. */
export const inputs = {
  volts: linear("V", 10),
  milliamps: linear("mA", 20),
  degrees: {
    unit: "°C",
    fromPin(millivolts) {
      const inside = Math.min(PIN_MV - 1, Math.max(1, millivolts));
      const ratio = inside / (PIN_MV - inside);
      return rounded(1 / (1 / T0 + Math.log(ratio) / BETA) - KELVIN, 1);
    },
    toPin(celsius) {
      const ratio = Math.exp(BETA * (1 / (celsius + KELVIN) - 1 / T0));
      return within((PIN_MV * ratio) / (1 + ratio));
    },
  },
};

/** The ranges of an analog output, which its jumper chooses, each with its conversion from a code of the DAC. */
export const outputs = {
  volts: { unit: "V", fromCode: (code) => ((code * 10) / LARGEST_CODE).toFixed(2) },
  milliamps: { unit: "mA", fromCode: (code) => ((code * 20) / LARGEST_CODE).toFixed(2) },
};

/** Returns the value of an analog channel as a share of full scale; null for any other channel. */
export function share(channel) {
  if (channel.kind === "ai") return channel.millivolts / PIN_MV;
  if (channel.kind === "ao") return channel.code / LARGEST_CODE;
  return null;
}

/** The levels of digital inputs as the unit reads them, by the kind of the channel or terminal: a relay has its jumper, and
 * switch and supply are inverted (docs/boards.md). */
const LEVELS = {
  di: (channel) => channel.energised,
  relay: (channel) => channel.manual ?? null,
  input: (terminal) => terminal.energised,
  switch: (terminal) => !terminal.high,
  supply: (terminal) => !terminal.present,
};

/** Returns whether a digital input is on; null for any other channel or terminal. */
export const level = (channel) => LEVELS[channel.kind]?.(channel) ?? null;

/** Labels of the five screw terminals of modules that do not have one terminal for each point. */
const LABELS = {
  none: ["", "", "", "", ""],
  "2relay": ["1 COM", "1 NO", "2 COM", "2 NO", "2 NC"],
};

/** Returns the labels of a module's five screw terminals. */
export const terminals = (module) => LABELS[module] ?? ["1", "2", "3", "4", "COM"];

/** Port of the only slot of a modio-02. The state of a board with one slot does not name the port. */
const ONLY_PORT = 5;

/** Returns the slots of a board, each with the first part of its paths. A board with terminals has none. */
export function slotsOf(state) {
  if (state.terminals) return [];
  if (!state.slots) {
    const { module, configured, channels } = state;
    return [{ port: ONLY_PORT, path: "", module, configured, channels }];
  }
  return state.slots.map((slot) => ({ ...slot, path: `slots/${slot.port}/` }));
}

/** Returns the name of point `number`, from 1, of a port, as in `modioctl`. */
export const pointName = (port, number) => `p${port}.${number}`;

/** Returns the Modbus address of point `number`, from 1, of a port (docs/points.md). */
export function address(port, number) {
  return `0x${((port - 1) * 4 + number - 1).toString(16).padStart(4, "0")}`;
}

/** Returns the port of an address, and the number of the point in it, from 1. */
export const portOf = (point) => Math.floor(point / 4) + 1;
export const numberOf = (point) => (point % 4) + 1;

/** Returns the name of the point with an address. */
export const nameOf = (point) => pointName(portOf(point), numberOf(point));

/** Returns the name of a terminal with that of its point, if it has one. */
export const terminalName = ({ name, point }) => (point === undefined ? name : `${nameOf(point)} (${name})`);

/** Returns the name of a unit in UCUM, for people. */
export const unitName = (code) => ({ Cel: "°C", uA: "µA" })[code] ?? code;

/** Returns the bytes of a frame, with spaces between them. */
export const spaced = (hex) => hex.match(/../g)?.join(" ") ?? "";

/** Whether a unit should answer this frame: a request that is valid and no broadcast. */
export const isAnswered = (frame) => frame.crc_ok && !frame.damaged && !frame.summary.startsWith("all units");

/** Whether a frame contains all of the words: in its meaning, its bytes, its sender, or as "bad". */
export function isShown(frame, words) {
  const from = frame.direction === "rx" ? "master" : "unit";
  const state = frame.crc_ok && !frame.damaged ? "" : "bad";
  const text = `${frame.summary} ${spaced(frame.bytes)} ${from} ${state}`.toLowerCase();
  // A user may type bytes without the spaces between them.
  const isIn = (word) => text.includes(word) || (/^([0-9a-f]{2})+$/.test(word) && text.includes(spaced(word)));
  return words.toLowerCase().split(/\s+/).every(isIn);
}
