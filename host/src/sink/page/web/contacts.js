// The contacts found, as a table.

import { ellipseOf, hueOf } from "./marks.js";
import { count, millimetres, withPrefix } from "./units.js";

// Numbers that change faster cannot be read.
const SHOWN_EVERY_MS = 120;
// Rows that there is place for.
const ROWS = 5;

// An error of place (mm): none known, or so large that its digits say nothing.
function placeError(errors) {
  if (!errors) return "";
  return errors.longM < 0.1 ? millimetres(errors.longM, errors.longM < 1e-3 ? 2 : 1) : "> 100";
}

const cell = (name, kind, text) => {
  const made = document.createElement(name);
  made.className = kind;
  made.textContent = text;
  return made;
};

function strength({ forceN, conductanceS, errorS }) {
  if (forceN !== null) return [withPrefix(forceN, "N"), ""];
  return [withPrefix(conductanceS, "S"), errorS === null ? "" : withPrefix(errorS, "S", 2)];
}

function row(contact) {
  const made = document.createElement("tr");
  const errors = ellipseOf(contact);
  const [value, error] = strength(contact);
  const id = cell("td", `id ${hueOf(contact.id)}`, contact.id ? String(contact.id) : "\u2013");
  made.append(id,
    cell("td", "", millimetres(contact.xM, 2)), cell("td", "", millimetres(contact.yM, 2)),
    cell("td", "error", placeError(errors)),
    cell("td", "", value), cell("td", "error", error));
  return made;
}

/** The table of contacts. */
export class ContactTable {
  constructor() {
    this.body = document.getElementById("contacts");
    this.rest = document.getElementById("no-contacts");
    this.strength = document.getElementById("strength");
    this.more = document.getElementById("more-contacts");
    this.shown = -Infinity;
  }

  /** Shows the contacts of an update. */
  show({ contacts }, now) {
    if (now - this.shown < SHOWN_EVERY_MS) return;
    this.shown = now;
    const strongest = [...contacts].sort((a, b) => (a.id ?? 0) - (b.id ?? 0) || b.conductanceS - a.conductanceS);
    this.body.replaceChildren(...strongest.slice(0, ROWS).map(row));
    this.strength.textContent = contacts.some(({ forceN }) => forceN !== null) ? "force" : "conductance";
    this.rest.hidden = contacts.length > 0;
    this.more.textContent = contacts.length > ROWS ? `and ${count(contacts.length - ROWS)} more` : "";
  }
}
