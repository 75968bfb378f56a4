// What is said of an answer in a few words: on the page, on the tiles of several detectors, and to a screen reader.

import { nameOf } from "./bars.js";
import { fixed } from "./units.js";

// While the first answer to a touch is searched, nobody knows what it is.
const isSearched = ({ choice }) => choice?.what === "searching";

/** What a passer-by calls it. */
export function headlineOf(update) {
  const { choice, contacts, image, shape, floor } = update;
  const what = choice?.what ?? "";
  if (isSearched(update)) return "Something touches";
  const counted = (word, count = contacts.length) => (count === 1 ? `1 ${word}` : `${count} ${word}s`);
  const other = update.otherContacts;
  if (shape) return other === null ? nameOf(shape) : `${nameOf(shape)} or ${counted("contact", other)}`;
  // Of a solver that chooses, contacts beside an image are what `contacts` would find; of others, they are its peaks.
  if (image.length && what !== "nothing") return contacts.length ? `Image, ${counted(what === "image" ? "contact" : "peak")}` : "Image";
  if (!contacts.length) return floor?.isPressed ? "Something touches" : "Nothing touches";
  if (other === null || other === contacts.length) return counted("contact");
  return `${Math.min(other, contacts.length)} or ${Math.max(other, contacts.length)} contacts`;
}

// Where nothing was found, and the board reads nothing lighter.
const belowFloor = ({ floorV, isPressed }) => `${isPressed ? "" : "or "}pressed more lightly than this board can read (${fixed(floorV, 2)} V)`;

// Shares that a person calls sure, and nearly.
const SURE = [[0.95, "sure"], [0.8, "nearly sure"], [0, "not sure"]];

/** How far it is to be believed, in a few words. */
export function sureOf(update) {
  const { certainty, contacts, flags, floor, image, shape } = update;
  if (isSearched(update)) return "looking for what it is";
  if (flags.includes("misfit")) return "not sure: the readings do not fit this";
  if (flags.includes("unfinished") && !image.length) return "looking for a better answer";
  if (floor && !contacts.length && !shape && !image.length) return belowFloor(floor);
  if (certainty === null || (!shape && (image.length || !contacts.length))) return "";
  const word = SURE.find(([from]) => certainty >= from)[1];
  // Nobody is surer than that.
  return `${word} of the ${shape ? "shape" : "number"} (${certainty >= 0.995 ? "> 99" : fixed(100 * certainty, 0)} %)`;
}

/** What stands in place of contacts where there are none. */
export function inPlaceOfContacts(update) {
  if (isSearched(update)) return "Looking for what touches.";
  return update.image.length ? "The image shows no single contacts." : `${headlineOf(update)}.`;
}
