// Functions that make and change elements.

export const byId = (id) => document.getElementById(id);

/** Makes an element. An attribute whose name begins with `on` is a listener. The value `true` makes an attribute without
 * a value; `false` and `undefined` make none. */
export const element = (tag, attributes = {}, ...children) => filled(document.createElement(tag), attributes, children);

/** Makes an element of an SVG drawing. */
export const drawing = (tag, attributes, ...children) =>
  filled(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);

function filled(made, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** Makes a drop-down list from pairs of value and text. */
export function select(attributes, choices) {
  const options = choices.map(([value, text]) => element("option", { value }, text));
  return element("select", attributes, ...options);
}

/** Sets a text. Does not touch the document if the text is the same. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
