// Requests to the registers of the unit. They are frames on the line, as those of any other master.

import { path, send } from "/api.js";
import { registers } from "/map.js";
import { byId, setText } from "/ui.js";

/** Meaning of the exceptions that a register returns. */
const EXCEPTIONS = {
  2: "the unit has no such register",
  3: "the unit does not allow this value",
  4: "the module does not answer",
  6: "the unit is locked, or a save is under way",
};

const word = (value) => (value & 0xffff).toString(16).padStart(4, "0");

/** Sends a request, and returns the reply in hexadecimal. Shows the reason and returns null if it fails. */
async function ask(pdu, label) {
  const reply = await send(path("pdu"), { pdu }, label);
  if (reply === null) return null;
  const [code, exception] = [reply.pdu.slice(0, 2), reply.pdu.slice(2, 4)].map((byte) => parseInt(byte, 16));
  if (code < 0x80) return reply.pdu;
  setText(byId("message"), `${label}: ${EXCEPTIONS[exception] ?? "the unit refuses"} (exception ${exception})`);
  return null;
}

/** Returns `count` registers from `first` on; null if the unit does not return them. */
export async function read(first, count, label) {
  const reply = await ask(`03${word(first)}${word(count)}`, label);
  return reply && reply.slice(4).match(/.{4}/g).map((digits) => parseInt(digits, 16));
}

/** Returns `count` coils from `first` on; null if the unit does not return them. */
export async function readCoils(first, count, label) {
  const reply = await ask(`01${word(first)}${word(count)}`, label);
  const bytes = reply && reply.slice(4).match(/../g).map((digits) => parseInt(digits, 16));
  return bytes && Array.from({ length: count }, (_, n) => (bytes[n >> 3] >> (n & 7)) % 2 === 1);
}

/** Opens the lock and writes registers from `first` on, in one request. Returns whether the unit has taken them. */
export async function write(first, words, label) {
  const open = `06${word(registers.key)}${word(registers.openingKey)}`;
  if (await ask(open, label) === null) return false;
  const head = `10${word(first)}${word(words.length)}${(2 * words.length).toString(16).padStart(2, "0")}`;
  return await ask(head + words.map(word).join(""), label) !== null;
}

/** Stores the settings of the unit in its flash. */
export const save = (label) => write(registers.command, [registers.save], label);
