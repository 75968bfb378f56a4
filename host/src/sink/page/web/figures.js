// The figures beside the picture, each by its name.

import { count, fixed } from "./units.js";
import { write } from "./words.js";

const microseconds = (us) => (us < 1000 ? [fixed(us, us < 100 ? 1 : 0), "µs"] : [fixed(us / 1000, us < 1e5 ? 1 : 0), "ms"]);

/**
 * In rows of two.
 * @type {[string, string, Function, Function?][]}
 */
const FIGURES = [
  ["frames/s", "Frames that came over the last second", ({ frames_per_s: rate }) => [count(rate), ""]],
  ["age p50", "Median age of answers when they are ready, since the last byte of their frame came", ({ age_us: age }) => microseconds(age.p50)],
  ["solved/s", "Frames that the solver answered over the last second", ({ solved_per_s: rate }) => [count(rate), ""]],
  ["age p99", "99 of 100 answers are younger than this when they are ready", ({ age_us: age }) => microseconds(age.p99)],
  ["skipped", "Frames that came and were not solved by themselves, because newer ones had come", ({ skipped }) => [count(skipped), ""]],
  ["all frames", "Frames received whole since the start; the mean of several scans each where the line is slower than the scan", ({ frames, folded }) => [count(frames), folded > 0.05 * frames ? `of ${fixed(1 + folded / frames, 1)} scans` : ""]],
  ["lost on the line", "Frames whose numbers are missing", ({ dropped }) => [count(dropped), ""], ({ dropped }) => dropped > 0],
  ["corrupt", "Stretches of bytes that were no message", ({ corrupt }) => [count(corrupt), ""], ({ corrupt }) => corrupt > 0],
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
    this.cells = FIGURES.map(([name, meaning, read, warns]) => {
      const [value, unit] = [element("span", "value", "\u2013"), element("span", "unit")];
      const cell = element("div", "figure", element("dt", "", name), element("dd", "", value, " ", unit));
      cell.title = meaning;
      return { cell, value, unit, read, warns };
    });
    document.getElementById("figures").replaceChildren(...this.cells.map(({ cell }) => cell));
  }

  /** Shows the statistics of a status message. */
  show({ statistics }) {
    for (const { cell, value, unit, read, warns } of this.cells) {
      read(statistics).forEach((words, i) => write(i ? unit : value, words));
      cell.classList.toggle("warning", Boolean(warns?.(statistics)));
    }
    const { frames, frames_per_s: rate, dropped, corrupt, skipped, age_us: age } = statistics;
    Object.assign(document.documentElement.dataset, {
      frames: String(frames), framesPerS: rate.toFixed(1), dropped: String(dropped), corrupt: String(corrupt),
      skipped: String(skipped), ageP99Us: String(age.p99),
    });
  }
}
