// The links of the unit: inputs that switch outputs without a master. The page reads them only when the user asks for it,
// because each request keeps a unit with COMM_TIMEOUT from noticing that its master is gone.

import { actions, readings, registers } from "/map.js";
import { address, pointName, portOf, slotsOf, terminalName, unitName } from "/model.js";
import * as modbus from "/modbus.js";
import { byId, element, select, setText } from "/ui.js";

const WORDS = 4;
/** Registers from the first links of all outputs to the second ones. */
const ROW = 32 * WORDS;
const NO_SOURCE = 0xffff;
const NONE = [NO_SOURCE, 0, 0, 0];
/** Bit of ACTION in a link that acts only while the master is gone. */
const ALONE = 0x100;
/** Time of a new pulse, in 0.1 s. */
const PULSE = 10;
const WHEN = [[0, "always"], [ALONE, "only without a master"]];

const [follow, invert, pulse] = ["follow", "invert", "pulse"].map((name) => actions.find(([, each]) => each === name)[0]);
const isNone = (words) => words[0] === NO_SOURCE && words[1] === 0;

let points = { inputs: [], outputs: [] };
/** The links that were read: register, name of the output, number and words. */
let links = [];
/** RANGE and SCALE of each point. */
let meaning = [];
/** Whether the page shows old words, because the user was typing when new ones came. */
let isStale = false;
/** Fulfilled when the last change has been written. */
let previous = Promise.resolve();

/** Returns the points that can be the source or the output of a link. A relay has its jumper, and its coil two higher.
 * The unit does not serve the points of a module that is not the configured one. */
function pointsOf(state) {
  if (state.terminals) return pointsOfTerminals(state.terminals);
  const slots = slotsOf(state).filter(({ module, configured }) => module === configured);
  const all = slots.flatMap((slot) => slot.channels.flatMap(({ kind }, n) => {
    const point = (number) => ({ port: slot.port, kind, name: pointName(slot.port, number), address: Number(address(slot.port, number)) });
    const made = { di: [point(n + 1)], ai: [point(n + 1)], do: [point(n + 1)], relay: [point(n + 1), point(n + 3)] }[kind] ?? [];
    return made.map((each, coil) => ({ ...each, isOutput: kind === "do" || coil === 1 }));
  }));
  return { inputs: all.filter((each) => !each.isOutput), outputs: all.filter((each) => each.isOutput) };
}

function pointsOfTerminals(terminals) {
  const all = terminals.filter(({ point, kind }) => point !== undefined && kind !== "output").map(({ name, kind, point }) => ({
    port: portOf(point), kind: ["voltage", "current", "potentiometer"].includes(kind) ? "ai" : "di",
    name: terminalName({ name, point }), address: point, isOutput: kind === "relay",
  }));
  return { inputs: all.filter((each) => !each.isOutput), outputs: all.filter((each) => each.isOutput) };
}

/** Shows the part of the page if the board has links, which needs several ports. */
export function show(state) {
  byId("links-section").hidden = !state.slots && !state.terminals;
  byId("links-section").inert = !state.powered;
  const now = pointsOf(state);
  if (JSON.stringify(now) === JSON.stringify(points)) return;
  points = now;
  forget();
}

/** Removes the links, before those of other modules or of another board are read. */
export function forget() {
  links = [];
  isStale = false;
  byId("links").hidden = true;
  byId("links-save").hidden = true;
}

/** Reads the links of all outputs, and what the values of the inputs mean. */
async function readAll() {
  const label = "Links";
  const found = [];
  const before = links;
  // The outputs of a module have consecutive addresses.
  for (const outputs of Object.values(Object.groupBy(points.outputs, ({ port }) => port))) {
    for (const number of [1, 2]) {
      const first = registers.links + (number - 1) * ROW + outputs[0].address * WORDS;
      const words = await modbus.read(first, outputs.length * WORDS, label);
      if (words === null) return;
      outputs.forEach(({ name }, n) => found.push({
        register: first + n * WORDS, output: name, number, words: words.slice(n * WORDS, (n + 1) * WORDS),
      }));
    }
  }
  found.sort((one, other) => one.output.localeCompare(other.output) || one.number - other.number);
  if (points.inputs.some(({ kind }) => kind === "ai")) {
    const [ranges, scales] = [await modbus.read(registers.range, 32, label), await modbus.read(registers.scale, 32, label)];
    if (ranges === null || scales === null) return;
    meaning = ranges.map((range, n) => [range, scales[n]]);
  }
  // The user may have chosen another board.
  if (links !== before) return;
  links = found;
  draw();
}

/** Changes a link, after the changes before it: `words` returns its new words from its present ones. Shows the link that
 * the unit then has. */
function change(link, words) {
  previous = previous.then(async () => {
    // The user may have chosen another board.
    if (!links.includes(link)) return;
    const before = link.words;
    const wanted = words(before);
    const isWritten = await modbus.write(link.register, wanted, `Link ${link.number} of ${link.output}`);
    if (isWritten) link.words = wanted;
    // Its fields show another value already, and the user may be typing the next one.
    if (isStale || !isWritten || wanted[0] !== before[0] || actionOf(wanted) !== actionOf(before)) draw();
  });
}

const isAnalog = (source) => points.inputs.some((each) => each.address === source && each.kind === "ai");
const actionOf = (words) => words[1] & 0xff;
const whenOf = (words) => words[1] & ALONE;

/** Returns the words of a link with another source. An analog input has other actions and values than a digital one. */
function withSource(words, source) {
  if (isAnalog(source) === isAnalog(words[0])) return [source, ...words.slice(1)];
  const action = [follow, invert].includes(actionOf(words)) ? actionOf(words) : follow;
  return [source, action | whenOf(words), 0, 0];
}

/** Returns the words of a link with another action. */
function withAction(words, action) {
  const [source, , high, low] = words;
  const values = isAnalog(source) ? [high, low] : [action === pulse ? PULSE : 0, 0];
  return [source, action | whenOf(words), ...values];
}

const withWhen = (words, when) => words.with(1, actionOf(words) | when);

/** Draws the links, but not while the user is typing a value, which would be lost: then when the field is left. */
function draw() {
  const active = document.activeElement;
  isStale = byId("links-rows").contains(active) && active.type === "number" && active.value !== active.defaultValue;
  if (isStale) {
    active.addEventListener("blur", () => previous.then(() => isStale && draw()), { once: true });
    return;
  }
  const focused = active?.id;
  const used = links.filter(({ words }) => !isNone(words));
  const free = links.filter((link) => isNone(link.words)
    && !links.some((other) => other.output === link.output && other.number < link.number && isNone(other.words)));
  byId("links-rows").replaceChildren(...used.map(row));
  byId("links-output").replaceChildren(...free.map((link) => element("option", { value: link.register }, link.output)));
  byId("links-add").disabled = free.length === 0 || points.inputs.length === 0;
  setText(byId("links-none"), used.length === 0 ? "The unit has no links." : "");
  byId("links").hidden = false;
  byId("links-save").hidden = false;
  if (!focused) return;
  byId(focused)?.focus();
  // What is typed next replaces the text, as in a field that was just entered.
  byId(focused)?.select?.();
}

function row(link) {
  const { register, output, number, words } = link;
  const [source] = words;
  const name = `link ${number} of ${output}`;
  const choice = (key, label, choices, value, changed) => {
    const made = select({
      id: `link-${register}-${key}`, "aria-label": `${label} of ${name}`,
      onchange: (event) => change(link, (now) => changed(now, Number(event.target.value))),
    }, choices);
    made.value = String(value);
    return made;
  };
  const inputs = points.inputs.map((each) => [each.address, each.name]);
  const suits = (action) => (isAnalog(source) ? [follow, invert].includes(action) : action > 0 && action < ALONE);
  const allowed = actions.filter(([action]) => action === actionOf(words) || suits(action));
  const cell = (...children) => element("td", {}, ...children);
  return element("tr", {},
    element("th", { scope: "row" }, output),
    cell(choice("source", "Input", inputs, source, withSource)),
    cell(choice("action", "Action", allowed, actionOf(words), withAction)),
    cell(choice("when", "Condition", WHEN, whenOf(words), withWhen)),
    cell(...values(link, name)),
    cell(element("button", { type: "button", "aria-label": `Remove ${name}`, onclick: () => change(link, () => NONE) }, "Remove")));
}

/** Makes the fields of the time of a pulse, or of the thresholds of an analog input. */
function values(link, name) {
  const [source] = link.words;
  const field = (at, label, exponent, text) => {
    const step = 10 ** exponent;
    const word = link.words[at];
    const number = isAnalog(source) && word > 0x7fff ? word - 0x10000 : word;
    const made = element("input", {
      id: `link-${link.register}-${at}`, type: "number", step, "aria-label": `${label} of ${name}`,
      onchange: () => {
        made.defaultValue = made.value;
        const value = Math.round(made.valueAsNumber / step);
        if (Number.isFinite(value)) change(link, (words) => words.with(at, value & 0xffff));
        else draw();
      },
    });
    made.defaultValue = (number * step).toFixed(Math.max(0, -exponent));
    return element("label", {}, `${text} `, made);
  };
  if (!isAnalog(source)) return actionOf(link.words) === pulse ? [field(2, "Time", -1, "for"), " s"] : [];
  const [range, scale] = meaning[source];
  const [, , unit, exponent] = readings.find((each) => each[0] === range && each[1] === scale) ?? [range, scale, "", 0];
  const [above, below] = actionOf(link.words) === invert ? ["off", "on"] : ["on", "off"];
  return [field(2, "Upper threshold", exponent, `${above} above`), " ",
    field(3, "Lower threshold", exponent, `${below} below`), ` ${unitName(unit)}`];
}

/** Connects the buttons. */
export function listen() {
  byId("links-read").addEventListener("click", readAll);
  byId("links-save").addEventListener("click", () => modbus.save("Save"));
  byId("links-add").addEventListener("click", () => {
    const link = links.find(({ register }) => register === Number(byId("links-output").value));
    const [input] = points.inputs;
    const toggle = actions.find(([, name]) => name === "toggle")[0];
    change(link, () => [input.address, input.kind === "ai" ? follow : toggle, 0, 0]);
  });
}
