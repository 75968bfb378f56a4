// The readings as a heat map: a row for each grounded electrode, a column for each electrode read.

import { colourMaps, css } from "./colours.js";
import { SteadyScale } from "./scale.js";
import { gradient, label, line, svg } from "./svg.js";
import { decimalsOf, fixed, niceStep, ticks } from "./units.js";
import { write } from "./words.js";

const MARGIN = { left: 40, right: 6, top: 4, bottom: 66 };
// Axes are drawn anew no more often than this while the scale moves.
const AXES_EVERY_MS = 100;
// Below this share of the drive the readings are mostly the converter's noise.
const FLOOR_SHARE = 0.01;
const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

/** Draws the readings; calls `onChoose(g, e)` when one is pointed at, and `onChoose()` when none is. */
export class ReadingsMap {
  moved; drawn;

  constructor(setup, theme, onChoose) {
    this.count = setup.electrodes.length;
    this.theme = theme;
    this.onChoose = onChoose;
    this.box = document.getElementById("readings");
    this.canvas = document.getElementById("readings-map");
    this.axes = document.getElementById("readings-axes");
    this.text = document.getElementById("reading");
    this.canvas.width = this.count;
    this.canvas.height = this.count;
    this.image = new ImageData(this.count, this.count);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.values = new Float32Array(this.count * this.count);
    this.scale = new SteadyScale(FLOOR_SHARE * setup.drive_v);
    this.chosen = null;
    this.#listen();
    this.layOut();
  }

  /** Shows the readings of an update. */
  show({ readings }, now) {
    if (readings.length !== this.values.length) return;
    this.values = readings;
    this.moved ||= this.scale.take(this.#largest(), now);
    if (this.moved && now - this.drawn > AXES_EVERY_MS) this.#drawAxes();
    this.#paint();
  }

  /** Fits the colours to the readings of now. */
  fit(now) {
    this.scale.fit(this.#largest(), now);
    this.layOut();
  }

  /** Colours of another theme. */
  recolour(theme) {
    this.theme = theme;
    this.layOut();
  }

  /** Fits everything into the space there is. */
  layOut() {
    const { clientWidth, clientHeight } = this.box;
    if (!clientWidth) return; // folded away
    const room = Math.min(clientWidth - MARGIN.left - MARGIN.right, clientHeight - MARGIN.top - MARGIN.bottom);
    this.cell = Math.max(1, room / this.count);
    this.size = this.cell * this.count;
    this.left = Math.max(MARGIN.left, Math.floor((clientWidth - this.size) / 2));
    const { style } = this.canvas;
    [style.left, style.top] = [`${this.left}px`, `${MARGIN.top}px`];
    [style.width, style.height] = [`${this.size}px`, `${this.size}px`];
    this.axes.setAttribute("viewBox", `0 0 ${clientWidth} ${clientHeight}`);
    this.#drawAxes();
    this.#paint();
  }

  #largest() {
    return this.values.reduce((a, b) => Math.max(a, b), 0);
  }

  #paint() {
    const colours = colourMaps(this.theme).readings;
    const factor = (colours.length - 1) / this.scale.max;
    this.values.forEach((value, i) => {
      this.pixels[i] = colours[Math.min(colours.length - 1, Math.max(0, Math.round(value * factor)))];
    });
    this.canvas.getContext("2d").putImageData(this.image, 0, 0);
  }

  #drawAxes() {
    [this.moved, this.drawn] = [false, performance.now()];
    const { left, cell, size } = this;
    const every = Math.ceil(22 / cell);
    const shown = Array.from({ length: this.count }, (_, i) => i).filter((i) => i % every === 0);
    const low = MARGIN.top + size;
    const across = shown.map((e) => label(left + (e + 0.5) * cell, low + 13, String(e), "tick-text"));
    const down = shown.map((g) => label(left - 6, MARGIN.top + (g + 0.5) * cell, String(g), "tick-text side", "end"));
    const titleG = label(0, 0, "grounded", "axis-text");
    titleG.setAttribute("transform", `translate(${left - 30} ${MARGIN.top + size / 2}) rotate(-90)`);
    const titleE = label(left + size / 2, low + 28, "electrode read", "axis-text");
    this.frame = svg("rect", { class: "chosen", width: cell, height: cell, visibility: "hidden" });
    const edge = svg("rect", { x: left, y: MARGIN.top, width: size, height: size, class: "outline" });
    this.axes.replaceChildren(...across, ...down, titleG, titleE, edge, ...this.#bar(low + 40), this.frame);
    this.#frameChosen();
  }

  #bar(y) {
    const { max } = this.scale;
    const { factor, symbol } = this.scale.prefixNow;
    const step = niceStep(max, 5);
    const colours = Array.from(colourMaps(this.theme).readings).filter((_, i) => i % 5 === 0).map(css);
    const marks = ticks(0, max, step).flatMap((value) => {
      const x = this.left + (value / max) * this.size;
      return [line(x, y + 8, x, y + 12, "tick"), label(x, y + 23, fixed(value / factor, decimalsOf(step / factor)), "tick-text")];
    });
    return [svg("defs", {}, gradient("reading-colours", colours, false)), svg("rect", {
      x: this.left, y, width: this.size, height: 8, rx: 2, class: "bar", fill: "url(#reading-colours)",
    }), ...marks, label(this.left - 8, y + 7.5, `${symbol}V`, "axis-text", "end")];
  }

  #listen() {
    this.box.onpointermove = (event) => this.#choose(this.#cellOf(event));
    this.box.onpointerleave = () => this.#choose(null);
    this.box.onblur = () => this.#choose(null);
    this.box.onkeydown = (event) => {
      const step = STEPS[event.key];
      if (!step) return;
      event.preventDefault();
      const clamp = (i) => Math.min(this.count - 1, Math.max(0, i));
      const from = this.chosen ?? [0, 0];
      this.#choose(this.chosen ? from.map((i, k) => clamp(i + step[k])) : from);
    };
  }

  #cellOf({ clientX, clientY }) {
    const box = this.box.getBoundingClientRect();
    const e = Math.floor((clientX - box.left - this.left) / this.cell);
    const g = Math.floor((clientY - box.top - MARGIN.top) / this.cell);
    const inside = (i) => i >= 0 && i < this.count;
    return inside(g) && inside(e) ? [g, e] : null;
  }

  #choose(cell) {
    this.chosen = cell;
    this.onChoose(...(cell ?? []));
    this.#frameChosen();
    this.tell();
  }

  #frameChosen() {
    this.frame.setAttribute("visibility", this.chosen ? "visible" : "hidden");
    if (!this.chosen) return;
    const [g, e] = this.chosen;
    this.frame.setAttribute("x", this.left + e * this.cell);
    this.frame.setAttribute("y", MARGIN.top + g * this.cell);
  }

  /** Tells the reading that is pointed at, or the largest. */
  tell() {
    const [g, e] = this.chosen ?? [];
    write(this.text, this.chosen
      ? `ground ${g}, read ${e}: ${fixed(this.values[g * this.count + e], 4)} V`
      : `largest ${fixed(this.#largest(), 3)} V`);
  }
}
