// The contacts found, as a table.

import { errorOf, placesOf } from "./bars.js";
import { inPlaceOfContacts } from "./headline.js";
import { ellipseOf } from "./marks.js";
import { hueOf } from "./palette.js";
import { barOf, strengthOf, valueOf, wordOf } from "./strength.js";
import { count, millimetres, withError, withPrefix } from "./units.js";
import { write } from "./words.js";

// Rows that there is place for.
const ROWS = 6;
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

// How firmly it presses: a number, a bar and a word; as a title what the readings tell less of, the conductance.
function strengthCell(contact, text, sheetS) {
  const share = (contact.conductanceS ?? 0) / sheetS;
  const made = document.createElement("meter");
  made.className = "firmness";
  made.value = barOf(share);
  const cell = element("td", "wide", element("span", "level", element("span", "value", text), made, element("span", "word", wordOf(share))));
  cell.title = titleOf(contact);
  return cell;
}

function titleOf({ forceN = null, forceErrorN, beyondMaximum, conductanceS, errorS, radiusM = null, areaM2 = null }) {
  const force = forceN === null ? [] : [`force ${withError(forceN, forceErrorN, "N")}${beyondMaximum ? ", beyond the largest that can be told" : ""}`];
  const error = errorS === null ? "" : ` ± ${withPrefix(errorS, "S", 2)}`;
  const conductance = conductanceS === null ? "conductance not known" : `conductance ${withPrefix(conductanceS, "S")}${error}`;
  const size = radiusM === null || areaM2 === null ? [] : [`radius ${millimetres(radiusM, 1)} mm`, `area ${(1e6 * areaM2).toPrecision(2)} mm²`];
  return [...force, conductance, ...size].join("; ");
}

function strengthText(contact) {
  const { forceN, forceErrorN, beyondMaximum, prefix } = contact;
  return forceN === null || beyondMaximum ? strengthOf(contact) : withError(forceN, forceErrorN, "N", prefix);
}

function row(contact, sheetS) {
  const { id, xM, yM } = contact;
  return element("tr", hueOf(id),
    element("td", "id", element("span", "badge-id", id ? String(id) : "\u2013")),
    element("td", "", `${millimetres(xM, 1)}, ${millimetres(yM, 1)}`),
    element("td", "error", placeError(ellipseOf(contact))), strengthCell(contact, strengthText(contact), sheetS));
}

function shapeRow(shape, sheetS) {
  const errorM = errorOf(shape);
  return element("tr", hueOf(null),
    element("td", "id", element("span", "badge-id", "\u2013")),
    element("td", "", ...placesOf(shape).map((place) => element("div", "", place))),
    element("td", "error", placeError(errorM === null ? null : { longM: errorM })), strengthCell(shape, strengthOf(shape), sheetS));
}

/** The table of contacts, or of the shape that touches. */
export class ContactTable {
  constructor({ sheet_conductance_s: sheetS }) {
    this.sheetS = sheetS;
    this.body = document.getElementById("contacts");
    this.rest = document.getElementById("no-contacts");
    this.strength = document.getElementById("strength");
    this.more = document.getElementById("more-contacts");
    this.table = this.body.parentElement;
  }

  /** Shows the contacts of the update that is told. */
  show(update) {
    const { contacts, shape } = update;
    const sorted = [...contacts].sort((a, b) => (a.id ?? 0) - (b.id ?? 0) || valueOf(b) - valueOf(a));
    const rows = shape ? [shapeRow(shape, this.sheetS)] : sorted.slice(0, ROWS).map((contact) => row(contact, this.sheetS));
    this.body.replaceChildren(...rows);
    // Where nothing touches, the words of before stay.
    if (contacts.length) write(this.strength, contacts.some(({ forceN }) => forceN !== null) ? "force" : "firmness");
    this.table.classList.toggle("forces", this.strength.textContent === "force");
    this.rest.hidden = rows.length > 0;
    this.rest.textContent = inPlaceOfContacts(update);
    this.more.textContent = contacts.length > ROWS ? `and ${count(contacts.length - ROWS)} more` : "";
  }
}
