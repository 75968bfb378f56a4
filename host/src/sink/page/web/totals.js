// What all contacts together press with, and where: what is seen from across the room.

import { millimetres, withPrefix } from "./units.js";
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
    write(this.name, total && total.forceN !== null ? "force" : "firmness");
    write(this.total, total ? strengthText(total) : "\u2013");
    write(this.centre, total ? `${total.centreM.map((m) => millimetres(m, 1)).join(", ")} mm` : "\u2013");
    document.documentElement.dataset.total = String(total ? total.forceN ?? total.conductanceS : 0);
  }
}

const strengthText = ({ forceN, conductanceS }) => (forceN === null ? withPrefix(conductanceS, "S") : withPrefix(forceN, "N"));
