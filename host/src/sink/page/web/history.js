// How firmly each contact pressed, and all together, over the last minute.

import { conductanceOf } from "./strength.js";

const KEPT_MS = 61_000;
// Samples are this far apart at least: more do not fit on a screen.
const EVERY_MS = 40;

/** Samples of each contact, by its number; those of a shape, or of an image without contacts, under 0. */
export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.lines = new Map();
    /** Of each sample: when it was by the page's clock (ms) and by the board's (s), and what all pressed with together. */
    this.turns = [];
    this.turn = 0;
    this.last = -Infinity;
    this.unit = "S";
  }

  /** Takes an update. */
  take({ contacts, total, timeS }, now) {
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
    // What has no number cannot be told apart from frame to frame: all of it together.
    const all = total ? total.forceN ?? total.conductanceS : 0;
    if (!numbered.length && all > 0) this.#add(0, all, now);
    this.turns.push({ turn: this.turn, at: now, timeS, total: all });
    while (now - this.turns[0].at > KEPT_MS) this.turns.shift();
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
