// Small helpers to make and change elements.

export const byId = (id) => document.getElementById(id);

/** Makes an element. An attribute that begins with `on` is a listener; `true` stands for a bare attribute. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
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

/** Changes a text, and leaves the document alone when the text is the same. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
