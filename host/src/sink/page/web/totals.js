// What all contacts together press with, and where: what is seen from across the room.

import { strengthOf } from "./strength.js";
import { millimetres } from "./units.js";
import { write } from "./words.js";

/** Their sum and its centre, as the program has them. */
export class Totals {
  constructor() {
    this.name = document.getElementById("total-name");
    this.total = document.getElementById("total");
    this.centre = document.getElementById("centre");
  }

  /** Shows those of the update that is told. */
  show({ total }) {
    // Where nothing touches, the word of before stays.
    if (total) write(this.name, total.forceN === null ? "firmness" : "force");
    write(this.total, total ? strengthOf(total) : "\u2013");
    // Several detectors have no centre.
    if (this.centre) write(this.centre, total ? `${total.centreM.map((m) => millimetres(m, 1)).join(", ")} mm` : "\u2013");
    document.documentElement.dataset.total = String(total ? total.forceN ?? total.conductanceS : 0);
  }
}
