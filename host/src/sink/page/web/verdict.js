// The first lines of the picture: what touches, how far to believe it, and what to know before it is.

import { headlineOf, sureOf } from "./headline.js";
import { fixed } from "./units.js";
import { write } from "./words.js";

// A screen reader is told what has stayed this long: it takes a second to say it, and nobody can follow every answer.
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

function ageText(ageS) {
  if (ageS === null) return "";
  return ageS < 10 ? `answer ${fixed(ageS * 1e3, 0)} ms old` : `answer ${fixed(ageS, 0)} s old`;
}

/** What the solver says of its answer. */
export class Verdict {
  announcing; announcer;

  constructor() {
    this.what = document.getElementById("choice");
    this.sure = document.getElementById("sure");
    this.residual = document.getElementById("residual");
    this.why = document.getElementById("why");
    this.chips = document.getElementById("warnings");
    this.told = "";
  }

  /** Shows the update that is told; `explanation` of the solver, for one that does not choose. */
  show(update, explanation) {
    const { choice, flags, residual, ageS } = update;
    const words = headlineOf(update);
    this.#announce(words);
    write(this.what, words);
    write(this.sure, sureOf(update));
    const left = residual === null ? [] : [`unexplained ${fixed(residual, 1)} × noise`];
    write(this.residual, [...left, ageText(ageS)].filter(Boolean).join(" · "));
    // What it leaves unexplained stands beside it.
    const why = choice ? choice.why.replace(/^residual [\d.]+ x noise(; )?/, "") : explanation;
    write(this.why, why);
    this.why.title = why;
    this.#warn(update);
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

  #warn({ flags, excluded, exchanged }) {
    const told = JSON.stringify([flags, excluded, exchanged]);
    if (told === this.told) return;
    this.told = told;
    const others = excluded.filter((electrode) => !exchanged.includes(electrode));
    const left = `${others.length === 1 ? "electrode" : "electrodes"} ${others.join(", ")} left out`;
    this.chips.replaceChildren(
      ...(exchanged.length ? [chip("bad", `wires ${exchanged.join(" and ")} exchanged`, "Readings fit once they are changed back; these electrodes are left out")] : []),
      ...(others.length ? [chip("bad", left, "Their readings cannot be right: a broken wire, a short, a bad channel")] : []),
      ...Object.keys(WARNINGS).filter((flag) => flags.includes(flag)).map((flag) => chip("", ...WARNINGS[flag])),
    );
  }
}
