// Requests to the simulator. Requests about a board are sent to the chosen board, or to the first one.

import { byId, setText } from "/ui.js";

let prefix = "/api/";
let whenChanged = () => {};
/** Fulfilled when the last change has been sent and its answer is shown. */
let previous = Promise.resolve();
/** Paths with a request under way, each with the next value to send. */
const streams = new Map();

export const path = (rest) => prefix + rest;

/** Chooses the board that later requests are about; null means the first one. */
export function chooseBoard(name) {
  prefix = name === null ? "/api/" : `/api/boards/${encodeURIComponent(name)}/`;
}

/** Sets the function that is called with the new state after every request that has changed something. */
export function onChange(listener) {
  whenChanged = listener;
}

/** Returns the JSON at an address, or null if the simulator refuses the request. */
export async function get(address) {
  const answer = await fetch(address);
  return answer.ok ? answer.json() : null;
}

/** Sends JSON and returns the reply. Shows the reason of a refusal after the label of the field, and returns null. */
export async function send(address, body, label) {
  try {
    const answer = await fetch(address, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    const got = await answer.json();
    setText(byId("message"), answer.ok ? "" : label ? `${label}: ${got.error}` : got.error);
    return answer.ok ? got : null;
  } catch {
    setText(byId("message"), "The simulator does not answer.");
    return null;
  }
}

/** Sends a change of the board, and shows the new state. Changes are sent one after another. A change that depends on
 * the state is a function that returns the body: it is called when the changes before it are shown. The promise is false
 * when the simulator refuses the change. */
export function post(rest, body, label) {
  const at = prefix;
  const sent = previous.then(async () => {
    const dependsOnState = typeof body === "function";
    if (dependsOnState && at !== prefix) return;
    const state = await send(at + rest, dependsOnState ? body() : body, label);
    if (state !== null && at === prefix) whenChanged(state);
    return state !== null;
  });
  previous = sent.catch(() => {});
  return sent;
}

/** Sends a value that changes while a slider is dragged: one request at a time, and always the last value. */
export async function stream(rest, body) {
  const running = streams.get(rest);
  if (running) {
    running.next = body;
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

/** Whether a request to this path is under way. */
export const isStreaming = (rest) => streams.has(rest);
