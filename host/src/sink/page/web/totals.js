// What all contacts together press with, and where: what is seen from across the room.

import { millimetres, withPrefix } from "./units.js";

// Numbers that change faster cannot be read.
const STAYS_MS = 120;

/** Their sum and its centre, as the program has them. */
export class Totals {
  constructor() {
    this.name = document.getElementById("total-name");
    this.total = document.getElementById("total");
    this.centre = document.getElementById("centre");
    this.since = -Infinity;
  }

  /** Shows those of an update. */
  show({ total }, now) {
    if (now - this.since < STAYS_MS) return;
    this.since = now;
    this.name.textContent = total && total.forceN !== null ? "force" : "firmness";
    this.total.textContent = total ? strengthText(total) : "\u2013";
    this.centre.textContent = total ? `${total.centreM.map((m) => millimetres(m, 1)).join(", ")} mm` : "\u2013";
    document.documentElement.dataset.total = String(total ? total.forceN ?? total.conductanceS : 0);
  }
}

const strengthText = ({ forceN, conductanceS }) => (forceN === null ? withPrefix(conductanceS, "S") : withPrefix(forceN, "N"));
