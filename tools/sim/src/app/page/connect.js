// How a master connects to the line: the endpoints, and commands for a terminal.

import { get } from "/api.js";
import { slotsOf, address } from "/model.js";
import { byId, element, setText } from "/ui.js";

const NAMES = {
  pty: "serial port (pty)", tcp: "RTU over TCP", "modbus-tcp": "Modbus TCP", "exact-line": "exact line",
  lora: "gateway radio (pty)", gdb: "GDB", http: "this page",
};

let endpoints = {};
let isAnswered = false;
let shown = null;

/** Whether the simulator has said which endpoints it has. */
export const isKnown = () => isAnswered;

/** Reads the endpoints of the simulator and shows them. */
export async function fetchEndpoints() {
  isAnswered = false;
  const answer = await get("/api/endpoints").catch(() => null);
  if (answer === null) return;
  isAnswered = true;
  endpoints = answer;
  byId("endpoints").replaceChildren(...Object.entries(endpoints).flatMap(([name, at]) =>
    [element("dt", {}, NAMES[name] ?? name), element("dd", {}, element("code", {}, at))]));
  if (shown !== null) show(shown);
}

/** Shows the commands for the line and the unit of a state. */
export function show(state) {
  shown = state;
  setText(byId("commands"), commands(state).join("\n"));
}

function commands({ line, address: unit, ...board }) {
  const { pty, tcp, "modbus-tcp": gateway } = endpoints;
  const lines = [];
  const settings = `--baud ${line.baud} --format ${line.format}`;
  if (pty) lines.push(`modioctl --port ${pty} ${settings} scan`);
  if (tcp) lines.push(`modioctl --tcp ${tcp} scan`);
  if (gateway) lines.push(`modioctl --modbus-tcp ${gateway} scan`);
  if (unit === null) return lines;
  // A board without slots has digital inputs at port 1.
  const { port: first, channels: [channel] } = slotsOf(board)[0] ?? { port: 1, channels: [{ kind: "di" }] };
  // Coils, or holding registers.
  const table = ["ai", "ao"].includes(channel.kind) ? 4 : 1;
  const read = `-a ${unit} -0 -r ${Number(address(first, 1))} -c 4 -1 -t ${table}`;
  const parity = { N: "none", E: "even", O: "odd" }[line.format[1]];
  if (pty) lines.push(`mbpoll -m rtu -b ${line.baud} -P ${parity} -s ${line.format[2]} ${read} ${pty}`);
  if (gateway) {
    const [host, port] = gateway.split(/:(?=\d+$)/);
    lines.push(`mbpoll -m tcp -p ${port} ${read} ${host}`);
  }
  return lines;
}
