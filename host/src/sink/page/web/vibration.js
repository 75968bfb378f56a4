// The course of the mean reading over the last two seconds, and its spectrum over the last four, which the program takes of every frame.

import { sizeCanvas } from "./layout.js";
import { faded, palette } from "./palette.js";
import { decimalsOf, fixed, niceStep, prefixOf, ticks, withPrefix } from "./units.js";
import { write } from "./words.js";

const MARGIN = { left: 38, right: 8, top: 10, bottom: 18 };
const HEIGHT = 104;
const FONT = "11px system-ui, sans-serif";
const DRAWN_EVERY_MS = 40;
// Points of the program, 4 ms each.
const POINTS = 500;
const POINT_S = 0.004;
// What a hand does of itself is slower: it runs out of the spectrum's picture, so that the rest can be seen.
const SLOW_HZ = 5;
// Less is noise, of the mean of 256 readings of 12 bits (V).
const LEAST_SWING_V = 1e-4;
const LEAST_AMPLITUDE_V = 2e-5;

/** A panel that opens by itself in the scene of a texture. */
export class VibrationPanel {
  constructor() {
    this.card = document.getElementById("vibration-card");
    this.said = document.getElementById("vibration-peak");
    this.canvases = ["course", "spectrum"].map((name) => document.getElementById(`vibration-${name}`));
    this.points = [];
    this.spectrum = null;
    this.scene = null;
    this.shown = -Infinity;
    this.colours = palette();
    this.card.ontoggle = () => this.layOut();
    this.layOut();
  }

  /** Takes the points of an update; while nothing is drawn too, so that none is missed. */
  take({ course }) {
    this.points.push(...course);
    this.points.splice(0, Math.max(0, this.points.length - POINTS));
  }

  /** Draws the course, ending now. */
  draw(now) {
    if (now - this.shown < DRAWN_EVERY_MS || !this.card.open) return;
    this.shown = now;
    this.#drawCourse();
  }

  /** Shows a status message. */
  show({ vibration, playing }) {
    if (playing.scene !== this.scene) {
      if (playing.scene === "texture") {
        this.card.open = true;
        this.layOut();
      }
      this.scene = playing.scene;
    }
    this.spectrum = vibration;
    const peak = vibration?.peak;
    write(this.said, peak ? `${fixed(peak.frequency_hz, 1)} Hz, ${withPrefix(peak.amplitude_v, "V", 2)}` : "no clear frequency");
    this.card.dataset.peakHz = peak ? String(peak.frequency_hz) : "";
    if (this.card.open) this.#drawSpectrum();
  }

  recolour() {
    this.colours = palette();
    this.layOut();
  }

  layOut() {
    if (!this.card.open) return;
    this.width = this.card.clientWidth - 28;
    this.contexts = this.canvases.map((canvas) => sizeCanvas(canvas, this.width, HEIGHT));
    this.#drawCourse();
    this.#drawSpectrum();
  }

  #drawCourse() {
    const { points } = this;
    const [low, high] = points.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
    const middle = points.length ? (low + high) / 2 : 0;
    const half = 0.55 * Math.max(points.length ? high - low : 0, LEAST_SWING_V);
    const seconds = POINTS * POINT_S;
    const axes = new Axes(this.contexts[0], this.width, this.colours, [-seconds, 0], [middle - half, middle + half]);
    axes.drawHeights("V");
    for (const share of [0.25, 0.5, 0.75]) axes.text(-share * seconds, `\u2212${fixed(share * seconds, 1)} s`);
    axes.text(0, "now", "right");
    axes.line(points.map((value, i) => [(i - points.length + 1) * POINT_S, value]), this.colours.accent, 1.5);
  }

  #drawSpectrum() {
    const { amplitudes_v: amplitudes = [], step_hz: stepHz = 1, peak = null } = this.spectrum ?? {};
    const fast = amplitudes.slice(Math.ceil(SLOW_HZ / stepHz));
    const most = 1.15 * fast.reduce((a, b) => Math.max(a, b), LEAST_AMPLITUDE_V);
    const endHz = Math.max(20, (amplitudes.length - 1) * stepHz);
    const axes = new Axes(this.contexts[1], this.width, this.colours, [0, endHz], [0, most]);
    axes.drawHeights("V");
    for (const hz of ticks(0, endHz, niceStep(endHz, 5))) axes.text(hz, fixed(hz, 0), hz > 0.95 * endHz ? "right" : "center");
    axes.text(0.9 * endHz, "Hz");
    axes.line(amplitudes.map((value, i) => [i * stepHz, value]), this.colours.accent, 1.5);
    if (peak) axes.mark([peak.frequency_hz, peak.amplitude_v], `${fixed(peak.frequency_hz, 1)} Hz`);
  }
}

// A small chart: from and to of both axes.
class Axes {
  context; width; colours; left; right; low; high;

  constructor(context, width, colours, [left, right], [low, high]) {
    Object.assign(this, { context, width, colours, left, right, low, high });
    context.clearRect(0, 0, width, HEIGHT);
    context.font = FONT;
    context.textBaseline = "middle";
  }

  x(value) { return MARGIN.left + ((value - this.left) / (this.right - this.left)) * (this.width - MARGIN.left - MARGIN.right); }

  y(value) { return HEIGHT - MARGIN.bottom - ((value - this.low) / (this.high - this.low)) * (HEIGHT - MARGIN.top - MARGIN.bottom); }

  drawHeights(unit) {
    const { context, colours, low, high } = this;
    const step = niceStep(high - low, 3);
    const { factor, symbol } = prefixOf(Math.max(Math.abs(low), Math.abs(high)));
    context.lineWidth = 1;
    context.textAlign = "right";
    for (const value of ticks(low, high, step)) {
      const y = Math.round(this.y(value)) + 0.5;
      context.strokeStyle = faded(colours.muted, 0.18);
      context.beginPath();
      context.moveTo(MARGIN.left, y);
      context.lineTo(this.width - MARGIN.right, y);
      context.stroke();
      context.fillStyle = colours.muted;
      context.fillText(fixed(value / factor, decimalsOf(step / factor)), MARGIN.left - 5, y);
    }
    context.textAlign = "left";
    context.fillText(`${symbol}${unit}`, 0, HEIGHT - 6);
  }

  text(value, words, align = "center") {
    this.context.fillStyle = this.colours.muted;
    this.context.textAlign = align;
    this.context.fillText(words, this.x(value), HEIGHT - 6);
  }

  line(points, colour, width) {
    const { context } = this;
    context.save();
    context.beginPath();
    context.rect(MARGIN.left, MARGIN.top - 4, this.width - MARGIN.left - MARGIN.right, HEIGHT - MARGIN.top - MARGIN.bottom + 5);
    context.clip();
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(this.x(x), this.y(y)) : context.moveTo(this.x(x), this.y(y))));
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.stroke();
    context.restore();
  }

  mark([x, y], words) {
    const { context, colours } = this;
    context.beginPath();
    context.arc(this.x(x), this.y(y), 3.5, 0, 2 * Math.PI);
    context.fillStyle = colours.ink;
    context.fill();
    context.font = `600 ${FONT}`;
    context.textAlign = "left";
    context.fillText(words, this.x(x) + 7, this.y(y) + 1);
  }
}
