// Requests to the simulator. Those about a board go to the board that was chosen, or to the first one.

import { byId, setText } from "/ui.js";

let prefix = "/api/";
let whenChanged = () => {};
/** Paths with a request under way, and the value to send after it. */
const streams = new Map();

export const path = (rest) => prefix + rest;

/** From now on requests are about this board; null means the first one. */
export function chooseBoard(name) {
  prefix = name === null ? "/api/" : `/api/boards/${encodeURIComponent(name)}/`;
}

/** Calls `listener` with the state after every request that has changed something. */
export function onChange(listener) {
  whenChanged = listener;
}

/** The JSON at an address, or null when there is none. */
export async function get(address) {
  const answer = await fetch(address);
  return answer.ok ? answer.json() : null;
}

/** Sends JSON and returns the answer; null when it was refused, for the reason that is then shown. */
export async function send(address, body) {
  try {
    const answer = await fetch(address, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    const got = await answer.json();
    setText(byId("message"), answer.ok ? "" : got.error);
    return answer.ok ? got : null;
  } catch {
    setText(byId("message"), "The simulator does not answer.");
    return null;
  }
}

/** Changes something on the board. */
export async function post(rest, body) {
  const at = prefix;
  const state = await send(at + rest, body);
  if (state !== null && at === prefix) whenChanged(state);
}

/** Sends a value that changes while it is dragged: one request at a time, and the last value in the end. */
export async function stream(rest, body) {
  const under = streams.get(rest);
  if (under) {
    under.next = body;
    return;
  }
  const own = { next: body };
  streams.set(rest, own);
  while (own.next !== null) {
    const now = own.next;
    own.next = null;
    await post(rest, now);
  }
  streams.delete(rest);
}

/** Whether values of this path are still on their way. */
export const isStreaming = (rest) => streams.has(rest);
