// How firmly each contact pressed, over the last minute.

import { conductanceOf } from "./strength.js";

const KEPT_MS = 61_000;
// Samples are this far apart at least: more do not fit on a screen.
const EVERY_MS = 40;

/** Samples of each contact, by its number; those of all together, where they have no numbers or are an image, under 0. */
export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.lines = new Map();
    this.turn = 0;
    this.last = -Infinity;
    this.unit = "S";
  }

  /** Takes an update. */
  take({ contacts, total }, now) {
    const unit = total && total.forceN !== null ? "N" : "S";
    if (total && unit !== this.unit) {
      // Newtons and siemens have no axis in common.
      this.clear();
      this.unit = unit;
    }
    if (now - this.last < EVERY_MS) return;
    this.last = now;
    this.turn += 1;
    const numbered = contacts.filter(({ id }) => id);
    for (const contact of numbered) this.#add(contact.id, unit === "N" ? contact.forceN : conductanceOf(contact), now);
    // Without numbers they cannot be told apart from frame to frame.
    if (!numbered.length && total) this.#add(0, total.forceN ?? total.conductanceS, now);
    for (const [id, line] of this.lines) {
      while (line.length && now - line[0].at > KEPT_MS) line.shift();
      if (!line.length) this.lines.delete(id);
    }
  }

  #add(id, value, at) {
    const line = this.lines.get(id) ?? [];
    // In turns one after the other, the contact was there in between.
    line.push({ at, value, turn: this.turn });
    this.lines.set(id, line);
  }

  /** The values at a moment: `[id, value]` of those that were there. */
  at(moment) {
    const near = (line) => line.findLast(({ at }) => at <= moment + EVERY_MS);
    return [...this.lines].map(([id, line]) => [id, near(line)])
      .filter(([, sample]) => sample && moment - sample.at < 4 * EVERY_MS + 100)
      .map(([id, sample]) => [id, sample.value]);
  }
}
