// What all contacts together press with, and where: what is seen from across the room.

import { centreOf } from "./bars.js";
import { valueOf } from "./strength.js";
import { millimetres, withPrefix } from "./units.js";

// Numbers that change faster cannot be read.
const STAYS_MS = 120;

/** Their sum and its centre. */
export class Totals {
  constructor(history) {
    this.history = history;
    this.name = document.getElementById("total-name");
    this.total = document.getElementById("total");
    this.centre = document.getElementById("centre");
    this.since = -Infinity;
  }

  /** Shows those of an update. */
  show(update, now) {
    if (now - this.since < STAYS_MS) return;
    this.since = now;
    const { unit, total, centreM } = this.of(update);
    this.name.textContent = unit === "N" ? "force" : "firmness";
    this.total.textContent = total > 0 ? withPrefix(total, unit) : "\u2013";
    this.centre.textContent = centreM ? `${centreM.map((m) => millimetres(m, 1)).join(", ")} mm` : "\u2013";
    document.documentElement.dataset.total = String(total);
  }

  /** The sum, and the mean place by how much each has of it (m); null of nothing. Places of an image are its nodes. */
  of({ contacts, shape, image }) {
    const parts = shape ? [{ value: valueOf(shape) ?? 0, at: centreOf(shape) }]
      : contacts.length ? contacts.map((contact) => ({ value: valueOf(contact) ?? 0, at: [contact.xM, contact.yM] }))
        : this.history.partsOf(image);
    const total = parts.reduce((sum, { value }) => sum + value, 0);
    const unit = contacts.some(({ forceN }) => forceN !== null) ? "N" : "S";
    if (!(total > 0)) return { unit, total: 0, centreM: null };
    return { unit, total, centreM: [0, 1].map((axis) => parts.reduce((sum, { value, at }) => sum + value * at[axis], 0) / total) };
  }
}
