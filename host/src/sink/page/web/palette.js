// The colours of the style sheet, for what is drawn on canvases.

const HUES = 8;
const NAMES = ["ink", "muted", "card", "edge", "accent", "good", "bad"];

/** The class that colours a contact: the same for the same number. */
export const hueOf = (id) => (id ? `hue-${(id - 1) % HUES}` : "hue-none");

/**
 * The colours of the theme in use: `ink`, `muted` and so on, and `hue(id)` of a contact.
 * @returns {Record<string, any>}
 */
export function palette() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  const hues = Array.from({ length: HUES }, (_, i) => read(`hue-${i}`));
  const colours = Object.fromEntries(NAMES.map((name) => [name, read(name)]));
  return { ...colours, hue: (id) => (id ? hues[(id - 1) % HUES] : colours.ink) };
}

/** `colour` of the style sheet, `#rrggbb`, with an opacity. */
export function faded(colour, opacity) {
  return `${colour}${Math.round(255 * opacity).toString(16).padStart(2, "0")}`;
}
