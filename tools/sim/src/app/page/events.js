// The events that a unit has reported with function 70, Fast Modbus (docs/fast-modbus.md).

import { nameOf } from "/model.js";

/** Number of events that the page keeps. */
const KEPT = 200;
const FAST_MODBUS = 0x46;
const EVENTS = 0x11;
/** Bytes of a packet in front of its events: unit address, function, sub-function, flag, number and length. */
const HEAD = 6;
const CRC = 2;
/** Kinds of events: a coil, a discrete input, a holding register, an input register; the unit has started, edges were lost. */
const BITS = [1, 2];
const WORDS = [3, 4];
const OF_UNIT = { 0x0f: "started", 0x80: "edges lost" };

/** The last events, oldest first: time in ms, address of the point, value, and words. */
let events = [];
/** The last packet of the unit. */
let last = "";

export const recent = () => events;

/** Forgets all events. */
export function reset() {
  events = [];
  last = "";
}

/** Adds the events of a frame, if it is a packet of this unit. A packet that the unit repeats, because it has received no
 * confirmation, is equal to the last one. */
export function add(frame, unit) {
  const bytes = frame.bytes.match(/../g).map((byte) => parseInt(byte, 16));
  const isPacket = frame.direction === "tx" && frame.crc_ok && !frame.damaged
    && bytes[0] === unit && bytes[1] === FAST_MODBUS && bytes[2] === EVENTS;
  if (!isPacket || frame.bytes === last) return;
  last = frame.bytes;
  const made = decode(bytes.slice(HEAD, -CRC)).map((event) => ({ at: frame.end_us / 1000, ...event }));
  events = events.concat(made).slice(-KEPT);
}

/** Returns the events in these bytes: length of the value, kind, address, and the value with its low byte first. */
function decode(bytes) {
  const made = [];
  for (let at = 0; at + 4 <= bytes.length; at += 4 + bytes[at]) {
    const [length, kind, high, low] = bytes.slice(at);
    const value = bytes.slice(at + 4, at + 4 + length).reduceRight((sum, byte) => sum * 256 + byte, 0);
    made.push(meaning(kind, high * 256 + low, value));
  }
  return made;
}

/** Returns an event in words. Those of the unit itself are the words of `modioctl events`. */
function meaning(kind, id, value) {
  if (BITS.includes(kind)) return { point: id, value, words: `${nameOf(id)} ${value === 0 ? "off" : "on"}` };
  if (WORDS.includes(kind)) return { point: id, value, words: `${nameOf(id)} ${value}` };
  return { words: (id === 0 && OF_UNIT[kind]) || `event ${id} ${value}` };
}
