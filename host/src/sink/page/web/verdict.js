// The first line of the picture: what touches, and what to know before it is believed.

import { nameOf } from "./bars.js";
import { fixed } from "./units.js";
import { write } from "./words.js";

// Words and warnings stay this long: what flickers cannot be read.
const STAYS_MS = 250;

// A screen reader is told what has stayed this long: it takes a second to say it, and nobody can follow every frame.
const ANNOUNCED_MS = 1000;

const WARNINGS = {
  saturated: ["at its limit", "Readings at the end of the converter's range, or contacts that conduct so well that pressing harder would change nothing"],
  misfit: ["readings do not fit", "The readings are not what the model gives for what was found: another sensor, a fault, or something that is no contact"],
  calibrate: ["sensor not as described", "The sensor differs from its description, and places are less sure for it: it is learned from what presses, or calibrated at once (K)"],
};

function chip(kind, text, title) {
  const made = document.createElement("span");
  made.className = `chip ${kind}`;
  made.textContent = text;
  made.title = title;
  return made;
}

// While the first answer to a touch is searched, nobody knows what it is.
const isSearched = ({ choice }) => choice?.what === "searching";

/** What stands in place of contacts where there are none. */
export function inPlaceOfContacts(update) {
  if (isSearched(update)) return "Looking for what touches.";
  return update.image.length ? "The image shows no single contacts." : "Nothing touches.";
}

// What a passer-by calls it.
function headline(update) {
  const { choice, contacts, image, shape } = update;
  const what = choice?.what ?? "";
  if (isSearched(update)) return "Something touches";
  const counted = (word) => (contacts.length === 1 ? `1 ${word}` : `${contacts.length} ${word}s`);
  if (shape) return nameOf(shape);
  // Of a solver that chooses, contacts beside an image are what `contacts` would find; of others, they are its peaks.
  if (image.length && what !== "nothing") return contacts.length ? `Image, ${counted(what === "image" ? "contact" : "peak")}` : "Image";
  if (!contacts.length) return "Nothing touches";
  const other = update.otherContacts;
  if (other === null || other === contacts.length) return counted("contact");
  return `${Math.min(other, contacts.length)} or ${Math.max(other, contacts.length)} contacts`;
}

// Shares that a person calls sure, and nearly.
const SURE = [[0.95, "sure"], [0.8, "nearly sure"], [0, "not sure"]];

// How far it is to be believed, in a few words.
function sureOf(update) {
  const { certainty, contacts, flags, image, shape } = update;
  if (isSearched(update)) return "looking for what it is";
  if (flags.includes("misfit")) return "not sure: the readings do not fit this";
  if (flags.includes("unfinished") && !image.length) return "looking for a better answer";
  if (shape || image.length || !contacts.length || certainty === null) return "";
  const word = SURE.find(([from]) => certainty >= from)[1];
  return `${word} of the number (${fixed(100 * certainty, 0)} %)`;
}

function ageText(ageS) {
  if (ageS === null) return "";
  return ageS < 10 ? `answer ${fixed(ageS * 1e3, 0)} ms old` : `answer ${fixed(ageS, 0)} s old`;
}

/** What the solver says of its answer. */
export class Verdict {
  flags; wires; announcing; announcer;

  constructor() {
    this.what = document.getElementById("choice");
    this.sure = document.getElementById("sure");
    this.residual = document.getElementById("residual");
    this.why = document.getElementById("why");
    this.chips = document.getElementById("warnings");
    this.seen = new Map();
    this.shown = -Infinity;
    this.told = "";
  }

  /** Shows an update; `explanation` of the solver, for one that does not choose. */
  show(update, explanation, now) {
    const { choice, flags, residual, ageS } = update;
    const words = headline(update);
    this.#announce(words);
    if (words !== this.what.textContent || now - this.shown > STAYS_MS) {
      this.shown = now;
      write(this.what, words);
      write(this.sure, sureOf(update) || "\u00a0");
      const left = residual === null ? [] : [`unexplained ${fixed(residual, 1)} × noise`];
      write(this.residual, [...left, ageText(ageS)].filter(Boolean).join(" · "));
      // What it leaves unexplained stands beside it.
      const why = choice ? choice.why.replace(/^residual [\d.]+ x noise(; )?/, "") : explanation;
      write(this.why, why);
      this.why.title = why;
    }
    this.#warn(flags, update, now);
    // Where no other answer comes, as where it is paused, only what this one says stays.
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#settle(), STAYS_MS);
    Object.assign(document.documentElement.dataset, { choice: choice?.what ?? "", flags: flags.join(" "), ageS: String(ageS) });
  }

  /** Says that the last answer is no longer of now. */
  hold() {
    if (this.what.textContent.trim()) this.sure.textContent = "the last answer";
  }

  #announce(words) {
    if (words === this.announcing) return;
    this.announcing = words;
    clearTimeout(this.announcer);
    this.announcer = setTimeout(() => {
      const line = document.getElementById("announced");
      write(line, words);
    }, ANNOUNCED_MS);
  }

  #settle() {
    this.seen.clear();
    this.#warn(this.flags, this.wires, performance.now());
  }

  #warn(flags, { excluded, exchanged }, now) {
    [this.flags, this.wires] = [flags, { excluded, exchanged }];
    flags.forEach((flag) => this.seen.set(flag, now));
    const shown = Object.keys(WARNINGS).filter((flag) => now - (this.seen.get(flag) ?? -Infinity) < STAYS_MS);
    const told = [...shown, ...excluded, "of them", ...exchanged].join();
    if (told === this.told) return;
    this.told = told;
    const others = excluded.filter((electrode) => !exchanged.includes(electrode));
    const left = `${others.length === 1 ? "electrode" : "electrodes"} ${others.join(", ")} left out`;
    this.chips.replaceChildren(
      ...(exchanged.length ? [chip("bad", `wires ${exchanged.join(" and ")} exchanged`, "Readings fit once they are changed back; these electrodes are left out")] : []),
      ...(others.length ? [chip("bad", left, "Their readings cannot be right: a broken wire, a short, a bad channel")] : []),
      ...shown.map((flag) => chip("", ...WARNINGS[flag])),
    );
  }
}
