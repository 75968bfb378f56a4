// The strip chart: firmness of each contact over the last 10 or 60 seconds.

import { sizeCanvas } from "./layout.js";
import { faded, palette } from "./palette.js";
import { decimalsOf, fixed, HeldPrefix, niceStep, ticks, withPrefix } from "./units.js";

const MARGIN = { left: 34, right: 8, top: 8, bottom: 18 };
// Samples are no closer, and less than a pixel's time changes nothing that can be seen.
const DRAWN_EVERY_MS = 40;
const FONT = "11px system-ui, sans-serif";
// From one value beside the pointer to the next (pixels).
const VALUE_HEIGHT = 13;

// The largest value that lasts: the lesser of two after each other, so that one odd sample does not flatten all others, and a click shows.
function lastingMost(line) {
  if (line.length < 2) return line.reduce((most, { value }) => Math.max(most, value), 0);
  let most = 0;
  for (let i = 1; i < line.length; i += 1) most = Math.max(most, Math.min(line[i].value, line[i - 1].value));
  return most;
}

/** Draws a [History]. */
export class StripChart {
  constructor(history, names = null) {
    this.history = history;
    this.names = names;
    this.canvas = document.getElementById("strip");
    this.prefix = new HeldPrefix();
    this.spanMs = 10_000;
    this.shown = -Infinity;
    this.hover = null;
    this.colours = palette();
    this.#listen();
    this.layOut();
  }

  /** Draws what the history has, ending now; held while the picture is. */
  draw(now) {
    if (now - this.shown < Math.max(DRAWN_EVERY_MS, this.spanMs / this.width)) return;
    this.shown = now;
    this.end = now;
    this.#redraw();
  }

  recolour() {
    this.colours = palette();
    this.layOut();
  }

  layOut() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    this.width = clientWidth - 28;
    this.height = Math.max(70, Math.min(150, clientHeight - 60));
    this.context = sizeCanvas(this.canvas, this.width, this.height);
    this.#redraw();
  }

  #listen() {
    for (const seconds of [10, 60]) {
      document.getElementById(`strip-${seconds}`).onclick = () => {
        this.spanMs = seconds * 1e3;
        for (const other of [10, 60]) document.getElementById(`strip-${other}`).setAttribute("aria-pressed", String(other === seconds));
        this.#redraw();
      };
    }
    this.canvas.onpointermove = (event) => {
      this.hover = event.clientX - this.canvas.getBoundingClientRect().left;
      this.#redraw();
    };
    this.canvas.onpointerleave = () => {
      this.hover = null;
      this.#redraw();
    };
  }

  #redraw() {
    const { context, width, height } = this;
    const end = this.end ?? performance.now();
    const lines = [...this.history.lines].map(([id, line]) => [id, line.filter(({ at }) => end - at < this.spanMs)]);
    this.most = 1.1 * (Math.max(0, ...lines.map(([, line]) => lastingMost(line))) || 1e-3);
    context.clearRect(0, 0, width, height);
    this.#drawAxes();
    for (const [id, line] of lines) this.#drawLine(id, line, end);
    this.#tell(end);
  }

  #x(at, end) { return this.width - MARGIN.right - ((end - at) / this.spanMs) * (this.width - MARGIN.left - MARGIN.right); }

  #y(value) { return this.height - MARGIN.bottom - (value / this.most) * (this.height - MARGIN.top - MARGIN.bottom); }

  #drawAxes() {
    const { context, width, colours, history } = this;
    const { factor, symbol } = this.prefix.of(this.most, performance.now());
    const step = niceStep(this.most, 3);
    context.font = FONT;
    context.textBaseline = "middle";
    context.lineWidth = 1;
    for (const value of ticks(0, this.most, step)) {
      const y = Math.round(this.#y(value)) + 0.5;
      context.strokeStyle = faded(colours.muted, value ? 0.18 : 0.5);
      context.beginPath();
      context.moveTo(MARGIN.left, y);
      context.lineTo(width - MARGIN.right, y);
      context.stroke();
      context.fillStyle = colours.muted;
      context.textAlign = "right";
      context.fillText(fixed(value / factor, decimalsOf(step / factor)), MARGIN.left - 6, y);
    }
    const seconds = this.spanMs / 1e3;
    context.fillText("now", width - MARGIN.right, this.height - 6);
    context.textAlign = "left";
    context.fillText(`${symbol}${history.unit}`, 0, this.height - 6);
    context.textAlign = "center";
    for (const share of [0.25, 0.5, 0.75]) {
      const x = width - MARGIN.right - share * (width - MARGIN.left - MARGIN.right);
      context.fillText(`\u2212${fixed(seconds * share, seconds < 20 ? 1 : 0)} s`, x, this.height - 6);
    }
  }

  #drawLine(id, line, end) {
    const { context, colours } = this;
    const colour = colours.hue(id);
    context.beginPath();
    line.forEach(({ at, value, turn }, i) => {
      const [x, y] = [this.#x(at, end), this.#y(value)];
      if (i && turn - line[i - 1].turn === 1) context.lineTo(x, y); else context.moveTo(x, y);
    });
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.lineJoin = "round";
    context.stroke();
  }

  // The values under the pointer, or of now.
  #tell(end) {
    const { context, colours, history } = this;
    const inside = this.hover !== null && this.hover >= MARGIN.left && this.hover <= this.width - MARGIN.right;
    const moment = inside ? end - ((this.width - MARGIN.right - this.hover) / (this.width - MARGIN.left - MARGIN.right)) * this.spanMs : end;
    const values = history.at(moment).sort(([a], [b]) => a - b);
    this.canvas.dataset.values = JSON.stringify(Object.fromEntries(values));
    if (!inside) return;
    context.fillStyle = faded(colours.ink, 0.5);
    context.fillRect(this.hover, MARGIN.top, 1, this.height - MARGIN.top - MARGIN.bottom);
    const isLeft = this.hover < this.width / 2;
    [context.textAlign, context.lineWidth, context.strokeStyle] = [isLeft ? "left" : "right", 4, colours.card];
    const say = (words, y, colour) => {
      const x = this.hover + (isLeft ? 8 : -8);
      context.strokeText(words, x, y);
      context.fillStyle = colour;
      context.fillText(words, x, y);
    };
    say(`${fixed((moment - end) / 1e3, 1)} s`, this.height - MARGIN.bottom - 6, colours.muted);
    // From the lowest up, each above the one before.
    let room = this.height - MARGIN.bottom - 6;
    for (const [id, value] of values.sort(([, a], [, b]) => a - b)) {
      const y = this.#y(value);
      context.beginPath();
      context.arc(this.hover, y, 3.5, 0, 2 * Math.PI);
      context.fillStyle = colours.hue(id);
      context.fill();
      room = Math.min(y, room - VALUE_HEIGHT);
      say(`${this.named(id)} ${withPrefix(value, history.unit)}`, room, colours.hue(id));
    }
  }

  /** What the line of that number is called. */
  named(id) { return this.names?.[id - 1] ?? (id ? String(id) : "all"); }
}
