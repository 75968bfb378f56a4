// Small helpers for SVG.

/** A new SVG element with attributes and children. */
export function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** A text of class `kind` about a point. */
export const label = (x, y, text, kind, anchor = "middle") =>
  svg("text", { x, y, class: kind, "text-anchor": anchor }, text);

/** A straight line. */
export const line = (x1, y1, x2, y2, kind) => svg("line", { x1, y1, x2, y2, class: kind });

/** A vertical or horizontal linear gradient through the colours, low end first. */
export function gradient(id, colours, upright) {
  const stops = colours.map((colour, i) => svg("stop", { offset: i / (colours.length - 1), "stop-color": colour }));
  const ends = upright ? { x1: 0, y1: 1, x2: 0, y2: 0 } : { x1: 0, y1: 0, x2: 1, y2: 0 };
  return svg("linearGradient", { id, ...ends }, ...stops);
}
