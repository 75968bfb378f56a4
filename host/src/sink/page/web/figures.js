// The figures beside the picture, each by its name.

import { count, fixed } from "./units.js";
import { write } from "./words.js";

const microseconds = (us) => (us < 1000 ? [fixed(us, us < 100 ? 1 : 0), "µs"] : [fixed(us / 1000, us < 1e5 ? 1 : 0), "ms"]);

// A count of what should not be stands out this long after it has grown.
const WARNED_MS = 5000;

/**
 * In rows of two; the last is a count of what should not be.
 * @type {[string, string, Function, Function?][]}
 */
const FIGURES = [
  ["frames/s", "Frames that came over the last second", ({ frames_per_s: rate }) => [count(rate), ""]],
  ["median age", "Half of the answers are younger than this when they are ready, since the last byte of their frame came", ({ age_us: age }) => microseconds(age.p50)],
  ["answers/s", "Answers over the last second", ({ solved_per_s: rate }) => [count(rate), ""]],
  ["99 % age", "99 of 100 answers are younger than this when they are ready", ({ age_us: age }) => microseconds(age.p99)],
  ["all frames", "Frames received whole since the start; the mean of several scans each where the line is slower than the scan", ({ frames, folded }) => [count(frames), folded > 0.05 * frames ? `of ${fixed(1 + folded / frames, 1)} scans` : ""]],
  ["skipped", "Frames that have no answer of their own, because newer ones had come: they count in its mean", ({ skipped }) => [count(skipped), ""]],
  ["lost on the line", "Frames that the board sent and that did not come, since the start", ({ dropped }) => [count(dropped), ""], ({ dropped }) => dropped],
  ["corrupt", "Pieces of what the board sent that could not be read, since the start", ({ corrupt }) => [count(corrupt), ""], ({ corrupt }) => corrupt],
];

function element(name, kind, ...children) {
  const made = document.createElement(name);
  made.className = kind;
  made.append(...children);
  return made;
}

/** Figures: rates, ages, counts. */
export class Figures {
  constructor() {
    this.cells = FIGURES.map(([name, meaning, read, countOf]) => {
      const [value, unit] = [element("span", "value", "\u2013"), element("span", "unit")];
      const cell = element("div", "figure", element("dt", "", name), element("dd", "", value, " ", unit));
      cell.title = meaning;
      return { cell, value, unit, read, countOf, count: Infinity, grewAt: -Infinity };
    });
    document.getElementById("figures").replaceChildren(...this.cells.map(({ cell }) => cell));
  }

  /** Shows the statistics of a status message. */
  show({ statistics }) {
    for (const figure of this.cells) {
      const { cell, value, unit, read, countOf } = figure;
      read(statistics).forEach((words, i) => write(i ? unit : value, words));
      if (countOf) cell.classList.toggle("warning", this.#grows(figure, countOf(statistics)));
    }
    const { frames, frames_per_s: rate, dropped, corrupt, skipped, age_us: age } = statistics;
    Object.assign(document.documentElement.dataset, {
      frames: String(frames), framesPerS: rate.toFixed(1), dropped: String(dropped), corrupt: String(corrupt),
      skipped: String(skipped), ageP99Us: String(age.p99),
    });
  }

  // Whether a count has grown a moment ago.
  #grows(figure, count) {
    const now = performance.now();
    if (count > figure.count) figure.grewAt = now;
    figure.count = count;
    return now - figure.grewAt < WARNED_MS;
  }
}
