// What all detectors of a page come to: their total, its course, the scale of their colours, and one button that records all.

import { drawBar } from "./frame.js";
import { History } from "./history.js";
import { sizeCanvas } from "./layout.js";
import { palette } from "./palette.js";
import { SteadyScale } from "./scale.js";
import { StripChart } from "./strip.js";
import { Told, STAYS_MS } from "./told.js";
import { Totals } from "./totals.js";
import { write } from "./words.js";

// About the colour bar: its names need room above and below (pixels).
const BAR = { left: 4, top: 12, below: 26 };

// What of several comes to, in newtons where those of all are known.
function sumOf(totals) {
  if (!totals.length) return null;
  const sum = (name) => (totals.some((total) => total[name] === null) ? null : totals.reduce((all, total) => all + total[name], 0));
  return { forceN: sum("forceN"), conductanceS: sum("conductanceS"), centreM: null };
}

/** Of tiles. */
export class Overview {
  scale = new SteadyScale(Number.MIN_VALUE);
  history = new History();
  told = new Told();
  totals = new Totals();
  toldAt = -Infinity;
  takenAt = null;
  bar = "";
  tiles; theme; strip; context; width; height;

  constructor(tiles, theme) {
    Object.assign(this, { tiles, theme, strip: new StripChart(this.history, tiles.map(({ name }) => name)) });
    this.colours = palette();
    this.card = document.getElementById("colours-card");
    this.record = document.getElementById("record");
    this.record.onclick = () => tiles.forEach((tile) => tile.record(!this.isRecording));
  }

  /** Whether any of them is recorded. */
  get isRecording() { return this.tiles.some(({ recording }) => recording); }

  /** Takes what tiles show at a moment, once. */
  take(now) {
    if (now === this.takenAt) return;
    this.takenAt = now;
    const live = this.tiles.filter(({ isLive, update }) => isLive && update);
    this.scale.take(Math.max(0, ...live.map(({ field }) => field.peak)), now);
    const touched = live.filter(({ update }) => update.total);
    const total = sumOf(touched.map(({ update }) => update.total));
    // As if each detector were a contact, of its place among them.
    const contacts = touched.map((tile) => ({ id: this.tiles.indexOf(tile) + 1, ...tile.update.total }));
    this.history.take({ contacts, total, timeS: now / 1e3 }, now);
    this.strip.draw(now);
    if (now - this.toldAt < STAYS_MS) return;
    this.toldAt = now;
    this.totals.show({ total: this.told.totalOf(total, now) });
    write(document.getElementById("touched"), `${touched.length} of ${this.tiles.length}`);
    this.#drawBar();
  }

  /** Says whether they are recorded. */
  tell() {
    const isRecording = this.isRecording;
    this.record.hidden = this.tiles.every(({ isPlayed }) => isPlayed);
    this.record.setAttribute("aria-pressed", String(isRecording));
    write(this.record, isRecording ? "Stop" : "Record");
  }

  /** Colours of another theme. */
  recolour(theme) {
    Object.assign(this, { theme, colours: palette() });
    this.layOut();
  }

  /** Fits charts into their cards. */
  layOut() {
    this.strip.recolour();
    [this.width, this.height] = [this.card.clientWidth - 20, this.card.clientHeight - 16];
    if (this.width <= 0 || this.height <= 0) return;
    this.context = sizeCanvas(document.getElementById("colours"), this.width, this.height);
    this.bar = "";
    this.#drawBar();
  }

  #drawBar() {
    const { context, scale, theme, colours, width, height } = this;
    const bar = `${scale.max} ${theme}`;
    if (!context || bar === this.bar) return;
    this.bar = bar;
    context.clearRect(0, 0, width, height);
    drawBar(context, { left: BAR.left, width: 2, top: BAR.top, height: height - BAR.top - BAR.below, narrow: true }, { scale, theme, colours });
  }
}
