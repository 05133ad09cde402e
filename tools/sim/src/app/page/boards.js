// The boards on the line, if there are several: an overview, and the choice of the board that the page shows.

import { get } from "/api.js";
import { byId, element, select } from "/ui.js";

const cell = (...children) => element("td", {}, ...children);

function row(board, choose) {
  const show = () => {
    byId("boards").value = board.name;
    choose(board.name);
  };
  return element("tr", {},
    element("th", { scope: "row" }, element("button", { type: "button", onclick: show }, board.name)),
    cell(board.board),
    cell(board.address === null ? "none" : String(board.address)),
    cell(board.powered ? "on" : "off"),
    cell(board.fault ? "on" : "off"),
    cell(board.modules.join(", ")));
}

/** Reads the boards and shows them. `choose` is called with the name of the board that the user chooses. */
export async function refresh(choose) {
  const boards = await get("/api/boards");
  if (boards === null || boards.length < 2) return;
  if (byId("boards") === null) {
    const choices = boards.map(({ name, board }) => [name, `${name} (${board})`]);
    byId("chooser").append("Board ", select({ id: "boards", onchange: (event) => choose(event.target.value) }, choices));
    byId("chooser").hidden = false;
    byId("boards-section").hidden = false;
  }
  // Leave the rows as they are while nothing changes, so that a button keeps the focus.
  const list = byId("overview");
  const shown = JSON.stringify(boards);
  if (list.dataset.shown === shown) return;
  list.dataset.shown = shown;
  list.replaceChildren(...boards.map((board) => row(board, choose)));
}
