// The front panel: shows the state of the board, and asks the simulator for what a person does to it.

import { signals, outputs, gapBefore, isShown } from "/model.js";

const FRAMES_KEPT = 500;
const CHART_MS = 60_000;
/** Colours of the chart, `--line-0` and so on in the style sheet. */
const COLORS = 4;
const MODULES = ["none", "4di", "4do", "2relay", "4ai", "4ao", "2ai2ao"];

const byId = (id) => document.getElementById(id);
let board = null;
let frames = [];
let samples = [];
let unitOfInput = new Map();

// ---------------------------------------------------------------- requests

async function post(path, body) {
  try {
    const answer = await fetch("/api/" + path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    const got = await answer.json();
    byId("message").textContent = answer.ok ? "" : got.error;
    if (answer.ok) show(got);
  } catch {
    byId("message").textContent = "The simulator does not answer.";
  }
}

// ---------------------------------------------------------------- elements

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

const setText = (node, text) => {
  if (node.textContent !== text) node.textContent = text;
};

// ---------------------------------------------------------------- the board

function slotsOf(state) {
  return state.slots ?? [{ port: null, module: state.module, channels: state.channels }];
}

const pathOf = (slot) => (slot.port === null ? "" : `slots/${slot.port}/`);

/** What cannot change without new elements: which modules are where. */
const shape = (state) => JSON.stringify([state.board, slotsOf(state).map((slot) => [slot.port, slot.module])]);

function show(state) {
  if (board === null || shape(board) !== shape(state)) build(state);
  board = state;
  setText(byId("name"), state.board);
  document.title = `${state.board}, a virtual board`;
  const power = byId("power");
  power.setAttribute("aria-checked", String(state.powered));
  setText(power, state.powered ? "Power is on" : "Power is off");
  byId("cycle").disabled = !state.powered;
  setText(byId("dip-value"), String(state.dip));
  [...byId("dip").children].forEach((button, n) =>
    button.setAttribute("aria-checked", String((state.dip >> n) % 2 === 1)));
  for (const name of ["run", "fault", "activity"]) {
    byId(`led-${name}`).classList.toggle("lit", state.leds[name]);
    setText(byId(`led-${name}-text`), state.leds[name] ? "on" : "off");
  }
  showLine(state);
  slotsOf(state).forEach((slot, n) => showSlot(slot, n, state.powered));
  const log = byId("log");
  const text = state.log_tail.join("\n");
  if (log.textContent !== text) {
    log.textContent = text;
    log.scrollTop = log.scrollHeight;
  }
}

function showLine(state) {
  const rows = {
    rate: `${state.line.baud} bit/s`,
    format: state.line.format,
    driver: state.driver_enable ? "sends" : "off",
    requests: String(state.line.rx_frames),
    replies: String(state.line.tx_frames),
  };
  const list = byId("line");
  if (list.children.length === 0) {
    for (const name of Object.keys(rows)) list.append(element("dt", {}, name), element("dd", { id: `line-${name}` }));
  }
  for (const [name, text] of Object.entries(rows)) setText(byId(`line-${name}`), text);
}

function build(state) {
  const dip = byId("dip");
  if (dip.children.length === 0) {
    for (let n = 0; n < 8; n += 1) {
      dip.append(element("button", {
        type: "button", role: "switch", "aria-checked": "false", "aria-label": `SW01 position ${n + 1}`,
        onclick: () => post("dip", { value: board.dip ^ (1 << n) }),
      }, String(n + 1)));
    }
  }
  unitOfInput = new Map();
  samples = [];
  byId("slots").replaceChildren(...slotsOf(state).map(buildSlot));
  const analog = slotsOf(state).some((slot) => slot.channels.some((c) => c.kind === "ai" || c.kind === "ao"));
  byId("chart-section").hidden = !analog;
}

function buildSlot(slot, n) {
  const title = slot.port === null ? "Slot" : `Port ${slot.port}`;
  const modules = MODULES.map((name) => element("option", { value: name }, name));
  const select = element("select", {
    id: `module-${n}`, "aria-label": `Module in ${title}`,
    onchange: (event) => post(pathOf(slot) + "module", { name: event.target.value }),
  }, ...modules);
  const channels = slot.channels.map((channel, at) => element("li", {},
    element("span", {}, `${at + 1}`), buildChannel(slot, n, channel, at + 1)));
  return element("div", { class: "slot", role: "group", "aria-label": title },
    element("header", {}, element("h3", {}, title), select),
    element("p", { class: "hint", id: `hint-${n}` }),
    element("ol", {}, ...channels));
}

function buildChannel(slot, n, channel, number) {
  const id = `c${n}-${number}`;
  const outside = (body) => post(`${pathOf(slot)}channels/${number}`, body);
  const name = `channel ${number}`;
  const toggle = (key, label) => element("button", {
    id, type: "button", role: "switch", "aria-checked": "false", "aria-label": `${label} ${number}`,
    onclick: (event) => outside({ [key]: event.currentTarget.getAttribute("aria-checked") !== "true" }),
  });
  switch (channel.kind) {
    case "di":
      return toggle("energised", "Digital input");
    case "relay":
      return element("span", { class: "lamp" }, element("span", { class: "led green", id: `${id}-lamp` }),
        element("output", { id: `${id}-text`, "aria-label": `Relay ${number}` }), toggle("manual", "Manual jumper of relay"));
    case "do":
      return element("span", { class: "lamp" }, element("span", { class: "led green", id: `${id}-lamp` }),
        element("output", { id: `${id}-text`, "aria-label": `Digital output ${number}` }));
    case "ai":
      return buildInput(id, name, outside);
    case "ao":
      return element("span", { class: "analog" },
        element("output", { id: `${id}-text`, "aria-label": `Analog output ${number}` }),
        element("meter", { id: `${id}-meter`, min: 0, max: 4095, "aria-label": `Analog output ${number}` }));
    default:
      return element("span", { class: "hint" }, "not connected");
  }
}

function buildInput(id, name, outside) {
  const signal = () => signals[unitOfInput.get(id) ?? "volts"];
  const set = (value) => {
    const millivolts = signal().toPin(value);
    if (Number.isFinite(millivolts)) outside({ millivolts });
  };
  const number = element("input", {
    type: "number", id: `${id}-number`, step: "any", "aria-label": `Analog input, ${name}`,
    onchange: (event) => set(Number(event.target.value)),
  });
  const range = element("input", {
    type: "range", id, min: 0, max: 3300, step: 1, "aria-label": `Analog input, ${name}, slider`,
    oninput: (event) => outside({ millivolts: Number(event.target.value) }),
  });
  const unit = element("select", {
    id: `${id}-unit`, "aria-label": `Unit of ${name}`,
    onchange: (event) => {
      unitOfInput.set(id, event.target.value);
      number.value = signal().fromPin(Number(range.value));
      show(board);
    },
  }, ...Object.entries(signals).map(([key, each]) => element("option", { value: key }, each.unit)));
  return element("span", { class: "analog" },
    element("label", {}, number, unit, element("output", { id: `${id}-text` })), range);
}

function showSlot(slot, n, powered) {
  const select = byId(`module-${n}`);
  select.value = slot.module;
  select.disabled = powered;
  setText(byId(`hint-${n}`), powered ? "Switch the power off to change the module." : "");
  slot.channels.forEach((channel, at) => showChannel(`c${n}-${at + 1}`, channel));
}

function showLamp(id, lit, text) {
  byId(`${id}-lamp`).classList.toggle("lit", lit);
  setText(byId(`${id}-text`), text);
}

function showSwitch(id, on, text) {
  byId(id).setAttribute("aria-checked", String(on));
  setText(byId(id), text);
}

function showChannel(id, channel) {
  switch (channel.kind) {
    case "di":
      showSwitch(id, channel.energised, channel.energised ? "24 V" : "open");
      break;
    case "relay":
      showLamp(id, channel.energised, channel.energised ? "energised" : "released");
      showSwitch(id, channel.manual, channel.manual ? "manual" : "automatic");
      break;
    case "do":
      showLamp(id, channel.on, channel.on ? "conducts" : "off");
      break;
    case "ai": {
      const signal = signals[unitOfInput.get(id) ?? "volts"];
      const number = byId(`${id}-number`);
      if (document.activeElement !== number) number.value = signal.fromPin(channel.millivolts);
      if (document.activeElement !== byId(id)) byId(id).value = channel.millivolts;
      byId(id).setAttribute("aria-valuetext", `${signal.fromPin(channel.millivolts)} ${signal.unit}`);
      setText(byId(`${id}-text`), `${channel.millivolts} mV at the pin`);
      break;
    }
    case "ao":
      byId(`${id}-meter`).value = channel.code;
      setText(byId(`${id}-text`), outputs(channel.code));
      break;
    default:
  }
}

// ---------------------------------------------------------------- chart

function sample() {
  if (board === null || byId("chart-section").hidden) return;
  const now = performance.now();
  const values = slotsOf(board).flatMap((slot) => slot.channels.map((channel, at) => {
    const name = `${slot.port === null ? "" : `p${slot.port}.`}${at + 1}`;
    if (channel.kind === "ai") return { name, share: channel.millivolts / 3300 };
    if (channel.kind === "ao") return { name, share: channel.code / 4095 };
    return null;
  })).filter(Boolean);
  samples = samples.filter((each) => each.at > now - CHART_MS);
  samples.push({ at: now, values });
  const lines = values.map((value, n) => {
    const points = samples.map((each) => {
      const x = 600 - ((now - each.at) / CHART_MS) * 600;
      const y = 156 - (each.values[n]?.share ?? 0) * 152;
      return `${x.toFixed(1)},${y.toFixed(1)}`;
    });
    const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
    line.setAttribute("points", points.join(" "));
    line.style.stroke = `var(--line-${n % COLORS})`;
    if (n >= COLORS) line.setAttribute("stroke-dasharray", `${2 + Math.floor(n / COLORS) * 4} 4`);
    return line;
  });
  byId("chart").replaceChildren(...lines);
  byId("legend").replaceChildren(...values.map((value, n) => {
    const entry = element("span", {}, `${value.name}: ${Math.round(value.share * 1000) / 10} %`);
    entry.style.setProperty("--color", `var(--line-${n % COLORS})`);
    return entry;
  }));
}

// ---------------------------------------------------------------- frames

function row(frame) {
  const bytes = frame.bytes.match(/../g)?.join(" ") ?? "";
  const gap = frame.gap === null ? "" : frame.gap.toFixed(2);
  const made = element("tr", { class: frame.crc_ok && !frame.damaged ? false : "bad" },
    element("td", { class: "number" }, (frame.start_us / 1e6).toFixed(3)),
    element("td", { class: "number" }, gap),
    element("td", {}, frame.direction === "rx" ? "master" : "unit"),
    element("td", { class: "bytes" }, bytes),
    element("td", {}, frame.summary));
  made.hidden = !isShown(frame, byId("filter").value);
  return made;
}

function addFrame(frame) {
  const last = frames.at(-1);
  if (last && frame.number <= last.number) return;
  frame.gap = gapBefore(last, frame);
  frames.push(frame);
  const body = byId("frames");
  body.append(row(frame));
  if (frames.length > FRAMES_KEPT) {
    frames.shift();
    body.firstElementChild.remove();
  }
  if (byId("follow").checked) {
    const scroll = body.closest(".scroll");
    scroll.scrollTop = scroll.scrollHeight;
  }
}

function filterFrames() {
  const wanted = byId("filter").value;
  [...byId("frames").children].forEach((made, n) => {
    made.hidden = !isShown(frames[n], wanted);
  });
}

async function fetchFrames() {
  const since = frames.at(-1)?.number ?? 0;
  const answer = await fetch(`/api/frames?since=${since}`);
  (await answer.json()).frames.slice(-FRAMES_KEPT).forEach(addFrame);
}

async function fetchFindings() {
  const answer = await fetch("/api/findings");
  const { findings } = await answer.json();
  const texts = findings.slice(-50).map((each) =>
    `${(each.at_us / 1e6).toFixed(3)} s, pc ${each.pc}: ${each.what}${each.count > 1 ? ` (${each.count} times)` : ""}`);
  const items = (texts.length > 0 ? texts : ["none"]).map((text) => element("li", {}, text));
  byId("findings").replaceChildren(...items);
}

// ---------------------------------------------------------------- life

function listen() {
  const events = new EventSource("/api/events");
  events.addEventListener("open", () => {
    setText(byId("connection"), "live");
    fetchFrames().catch(() => {});
  });
  events.addEventListener("error", () => setText(byId("connection"), "the simulator does not answer; trying again"));
  events.addEventListener("state", (event) => show(JSON.parse(event.data)));
  events.addEventListener("frame", (event) => addFrame(JSON.parse(event.data)));
  events.addEventListener("lost", () => fetchFrames().catch(() => {}));
}

byId("power").addEventListener("click", () => post("power", { on: !board.powered }));
byId("cycle").addEventListener("click", () => post("power", { cycle: true }));
byId("filter").addEventListener("input", filterFrames);
byId("clear").addEventListener("click", () => {
  frames = frames.slice(-1);
  byId("frames").replaceChildren(...frames.map(row));
});
setInterval(sample, 250);
setInterval(() => fetchFindings().catch(() => {}), 2000);
fetchFindings().catch(() => {});
listen();
