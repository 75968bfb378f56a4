// The upper end of a colour scale. It is steady, so that a harder press looks harder; robust, so that one odd frame changes
// nothing; and never so high that what is there cannot be seen.

import { HeldPrefix } from "./units.js";

// Peaks of which the median counts: two odd frames among them change nothing.
const PEAKS = 7;
const PEAK_AGE_MS = 400;
// The scale rises to a lasting peak with this time constant, at most by this factor in a tenth of a second.
const RISE_MS = 80;
const MOST_RISE = 2;
// It falls slowly when values have stayed below this share for a while, fast below that one, where colours would hardly show.
const LOW = 0.4;
const HIDDEN = 0.05;
const PATIENCE_MS = 5000;
const FALL_MS = 2500;
const FALL_FAST_MS = 600;
const HEADROOM = 1.15;

const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

/** A colour scale from zero to `max`, never less than `floor`, under which all is noise. */
export class SteadyScale {
  constructor(floor, first = floor) {
    this.floor = floor;
    this.max = Math.max(floor, first);
    this.peaks = [];
    this.since = 0;
    this.last = null;
    this.isFixed = false;
    this.prefix = new HeldPrefix();
  }

  /** The SI prefix that its marks are written with. */
  get prefixNow() { return this.prefix.of(this.max, performance.now()); }

  /** Ends at `max` whatever comes; at null it follows again what comes. */
  fix(max) {
    this.isFixed = max !== null;
    if (this.isFixed) this.max = max;
  }

  /** Is also that of a detector whose scale is never less than `floor` and begins with `max`; the scale itself. */
  least(floor, max) {
    this.floor = Math.max(this.floor, floor);
    this.max = Math.max(this.max, max);
    return this;
  }

  /** Takes the largest value of a frame at time `now` (ms); says whether `max` changed. */
  take(value, now) {
    const elapsed = Math.min(200, now - (this.last ?? now));
    this.last = now;
    this.peaks.push([now, value]);
    while (this.peaks.length > PEAKS || (this.peaks.length > 3 && now - this.peaks[0][0] > PEAK_AGE_MS)) this.peaks.shift();
    const peak = median(this.peaks.map(([, v]) => v));
    const before = this.max;
    if (!this.isFixed && this.peaks.length >= 3 && peak > this.floor) this.#follow(peak, now, elapsed);
    return this.max !== before;
  }

  /** Fits the scale to `value` now. */
  fit(value, now) {
    this.peaks = [];
    this.since = now;
    if (!this.isFixed) this.max = Math.max(this.floor, HEADROOM * value);
  }

  /** Share of the colours, 0 to 1, that shows a value: its square root, so that light touches show beside firm ones. */
  share(value) { return Math.sqrt(Math.min(1, Math.max(0, value / this.max))); }

  #follow(peak, now, elapsed) {
    if (peak > LOW * this.max) this.since = now;
    if (peak > this.max) this.#approach(HEADROOM * peak, RISE_MS, elapsed);
    else if (peak < HIDDEN * this.max) this.#approach(HEADROOM * peak, FALL_FAST_MS, elapsed);
    else if (now - this.since > PATIENCE_MS) this.#approach(HEADROOM * peak, FALL_MS, elapsed);
  }

  // In the logarithm, so that rising tenfold and falling tenfold look alike.
  #approach(target, constantMs, elapsed) {
    const step = Math.log(target / this.max) * (1 - Math.exp(-elapsed / constantMs));
    const most = Math.log(MOST_RISE) * elapsed / 100;
    this.max = Math.max(this.floor, this.max * Math.exp(Math.min(step, most)));
  }
}
