// The line over the picture: what was chosen and why, and what to know before it is believed.

import { fixed } from "./units.js";

// A warning stays this long after the last frame with it, and a reason until the next is due: what flickers cannot be read.
const WARNING_STAYS_MS = 800;
const REASON_STAYS_MS = 400;

const WARNINGS = {
  saturated: ["saturated", "Readings at the end of the converter's range, or contacts that conduct so well that more would change nothing"],
  misfit: ["readings do not fit", "The readings are not what the model gives for what was found"],
  unfinished: ["cut short", "A cheaper answer, or a search that stopped at its limit of steps"],
};

function chip(kind, text, title) {
  const made = document.createElement("span");
  made.className = `chip ${kind}`;
  made.textContent = text;
  made.title = title;
  return made;
}

const leftText = (residual) => (residual === null ? "" : `; it leaves ${fixed(residual, 1)} times the noise`);

/** What the solver says of its answer. */
export class Verdict {
  constructor() {
    this.what = document.getElementById("choice");
    this.why = document.getElementById("why");
    this.chips = document.getElementById("warnings");
    this.seen = new Map();
    this.reasonShown = -Infinity;
    this.told = "";
  }

  /** Shows an update; `explanation` of the solver, for one that does not choose. */
  show({ choice, flags, excluded, residual }, explanation, now) {
    const what = choice?.what ?? "";
    if (what !== this.what.textContent || now - this.reasonShown > REASON_STAYS_MS) {
      this.reasonShown = now;
      this.what.textContent = what;
      this.why.textContent = choice ? choice.why : `${explanation}${leftText(residual)}`;
      this.why.title = this.why.textContent;
    }
    this.#warn(flags, excluded, now);
    Object.assign(document.documentElement.dataset, { choice: what, flags: flags.join(" "), excluded: excluded.join(" ") });
  }

  #warn(flags, excluded, now) {
    flags.forEach((flag) => this.seen.set(flag, now));
    const shown = Object.keys(WARNINGS).filter((flag) => now - (this.seen.get(flag) ?? -Infinity) < WARNING_STAYS_MS);
    const told = [...shown, ...excluded].join();
    if (told === this.told) return;
    this.told = told;
    const left = excluded.length === 1 ? `electrode ${excluded[0]} left out` : `electrodes ${excluded.join(", ")} left out`;
    this.chips.replaceChildren(
      ...(excluded.length ? [chip("bad", left, "Their readings cannot be right: a broken or exchanged wire, a short, a bad channel")] : []),
      ...shown.map((flag) => chip("", ...WARNINGS[flag])),
    );
  }
}
