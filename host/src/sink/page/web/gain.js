// How much the colours tell: up to which pressure they go, by itself or as the person says, who is asked once.

import { withPrefix } from "./units.js";

// Ends that can be chosen: 1, 2 and 5 of so many decades from the least on, below which all is noise.
const DECADES = 4;
const STEPS = [1, 2, 5];
const KEPT_AS = "colours-to";

function endsFrom(least) {
  const first = Math.floor(Math.log10(least));
  const all = Array.from({ length: DECADES + 1 }, (_, decade) => STEPS.map((step) => Number((step * 10 ** (first + decade)).toPrecision(1)))).flat();
  return all.filter((end) => end >= least && end <= least * 10 ** DECADES);
}

/** The select of the scale's end; calls `choose(end)` with the one chosen (S/m2), or null where the scale is to follow by itself. */
export class GainSelect {
  constructor(least, choose) {
    this.select = document.getElementById("gain");
    this.choose = choose;
    const options = endsFrom(least).map((end) => new Option(withPrefix(end, "S/m²", 1), String(end)));
    this.select.replaceChildren(new Option("automatic", ""), ...options);
    this.select.value = localStorage.getItem(KEPT_AS) ?? "";
    if (this.select.selectedIndex < 0) this.select.value = "";
    this.select.onchange = () => this.#chosen();
    this.#apply();
  }

  /** More gain (1) or less (-1): the next end below or above the chosen one, or `now` where none is. */
  step(direction, now) {
    const ends = Array.from(this.select.options, ({ value }) => Number(value)).slice(1);
    const from = Number(this.select.value) || now;
    const next = direction > 0 ? ends.findLast((end) => end < from * 0.999) : ends.find((end) => end > from * 1.001);
    if (next === undefined) return;
    this.select.value = String(next);
    this.#chosen();
  }

  /** Lets the scale follow by itself again. */
  release() {
    this.select.value = "";
    this.#chosen();
  }

  #chosen() {
    localStorage.setItem(KEPT_AS, this.select.value);
    this.#apply();
  }

  #apply() { this.choose(Number(this.select.value) || null); }
}
