// What values mean, without the page.

const PIN_MV = 3300;
/** 10 V and 20 mA are full scale at the pin (docs/wiring.md). */
const KELVIN = 273.15;
/** The firmware's default thermistor: 10 kOhm at 25 degrees, B = 3950 K, under a pull-up of 10 kOhm. */
const BETA = 3950;
const T0 = 25 + KELVIN;

const within = (millivolts) => Math.min(PIN_MV, Math.max(0, Math.round(millivolts)));
const rounded = (value, digits) => Number(value.toFixed(digits));

const linear = (unit, full) => ({
  unit,
  fromPin: (millivolts) => rounded((millivolts * full) / PIN_MV, 3),
  toPin: (value) => within((value * PIN_MV) / full),
});

/** The units of an analog input: from millivolts at the pin, and to them. */
export const signals = {
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

/** What a code of an analog output is, by its jumper. */
export function outputs(code) {
  const share = code / 4095;
  return `${(share * 10).toFixed(2)} V or ${(share * 20).toFixed(2)} mA`;
}

/** Milliseconds of silence before a frame; null before the first. */
export function gapBefore(last, frame) {
  return last ? (frame.start_us - last.end_us) / 1000 : null;
}

/** Whether a frame has all of the words in its meaning, its bytes or its direction. */
export function isShown(frame, words) {
  const from = frame.direction === "rx" ? "master" : "unit";
  const text = `${frame.summary} ${frame.bytes} ${from} ${frame.crc_ok ? "" : "bad"}`.toLowerCase();
  return words.toLowerCase().split(/\s+/).every((word) => text.includes(word));
}
