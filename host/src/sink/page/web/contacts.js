// The contacts found, as a table.

import { errorOf, placesOf } from "./bars.js";
import { ellipseOf, strengthOf } from "./marks.js";
import { hueOf } from "./palette.js";
import { count, millimetres, withError, withPrefix } from "./units.js";
import { inPlaceOfContacts } from "./verdict.js";

// Rows that there is place for.
const ROWS = 6;
// Firmness in words and as a bar: conductance over the sheet conductance, from the lightest touch that linear theory describes
// (a thirtieth) to a press that conducts as well as the detector itself and more.
const WORDS = [[0.03, "light"], [0.3, "medium"], [1, "firm"], [Infinity, "hard"]];
const BAR = { least: 0.003, most: 3 };

const wordOf = (share) => WORDS.find(([below]) => share < below)[1];
const barOf = (share) => Math.min(1, Math.max(0.02, Math.log(share / BAR.least) / Math.log(BAR.most / BAR.least)));

// An error of place (mm): none known, or so large that its digits say nothing.
function placeError(errors) {
  if (!errors) return "";
  return errors.longM < 0.1 ? millimetres(errors.longM, errors.longM < 1e-3 ? 2 : 1) : "> 100";
}

function element(name, kind, ...children) {
  const made = document.createElement(name);
  made.className = kind;
  made.append(...children);
  return made;
}

function bar(share) {
  const made = document.createElement("meter");
  made.className = "firmness";
  made.value = barOf(share);
  return element("td", "wide", element("span", "level", made, element("span", "word", wordOf(share))));
}

// What it presses with, in newtons with their standard error where they are known; as a title the conductance too.
function strengthCell(contact) {
  const { forceN, forceErrorN, beyondMaximum, conductanceS, errorS } = contact;
  const value = element("td", "value", forceN === null || beyondMaximum ? strengthOf(contact) : withError(forceN, forceErrorN, "N"));
  const conductance = conductanceS === null ? "conductance not known" : errorS === null ? withPrefix(conductanceS, "S") : `${withPrefix(conductanceS, "S")} ± ${withPrefix(errorS, "S", 2)}`;
  const force = forceN === null ? "" : `${withError(forceN, forceErrorN, "N")}${beyondMaximum ? ", beyond the largest force that can be told" : ""}; `;
  value.title = `${force}${conductance}`;
  return value;
}

function row(contact, sheetS) {
  const { id, xM, yM, conductanceS } = contact;
  return element("tr", hueOf(id),
    element("td", "id", element("span", "badge-id", id ? String(id) : "\u2013")),
    element("td", "", `${millimetres(xM, 1)}, ${millimetres(yM, 1)}`),
    element("td", "error", placeError(ellipseOf(contact))), strengthCell(contact), bar(Math.max(1e-9, (conductanceS ?? 0) / sheetS)));
}

function shapeRow(shape, sheetS) {
  const { conductanceS, errorS } = shape;
  const value = element("td", "value", withPrefix(conductanceS, "S"));
  value.title = errorS === null ? value.textContent : `${value.textContent} ± ${withPrefix(errorS, "S", 2)}`;
  const errorM = errorOf(shape);
  return element("tr", hueOf(null),
    element("td", "id", element("span", "badge-id", "\u2013")),
    element("td", "", ...placesOf(shape).map((place) => element("div", "", place))),
    element("td", "error", placeError(errorM === null ? null : { longM: errorM })), value, bar(Math.max(1e-9, conductanceS / sheetS)));
}

/** The table of contacts, or of the shape that touches. */
export class ContactTable {
  constructor({ sheet_conductance_s: sheetS }) {
    this.sheetS = sheetS;
    this.body = document.getElementById("contacts");
    this.rest = document.getElementById("no-contacts");
    this.strength = document.getElementById("strength");
    this.more = document.getElementById("more-contacts");
  }

  /** Shows the contacts of the update that is told. */
  show(update) {
    const { contacts, shape } = update;
    const sorted = [...contacts].sort((a, b) => (a.id ?? 0) - (b.id ?? 0) || b.conductanceS - a.conductanceS);
    const rows = shape ? [shapeRow(shape, this.sheetS)] : sorted.slice(0, ROWS).map((contact) => row(contact, this.sheetS));
    this.body.replaceChildren(...rows);
    this.strength.textContent = contacts.some(({ forceN }) => forceN !== null) ? "force" : "conductance";
    this.rest.hidden = rows.length > 0;
    this.rest.textContent = inPlaceOfContacts(update);
    this.more.textContent = contacts.length > ROWS ? `and ${count(contacts.length - ROWS)} more` : "";
  }
}
