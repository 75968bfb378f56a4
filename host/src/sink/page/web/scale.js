// The upper end of a colour scale. It grows at once to hold a larger value, and shrinks only after the values have stayed
// far below it for a while: a frame is never stretched to fill the colours, so that a harder press looks harder.

const NICE = [1, 1.5, 2, 3, 4, 5, 7, 10];
const PATIENCE_MS = 12_000;
const SHRINK_BELOW = 0.3;

/** The smallest nice number that holds `value`. */
function niceAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * NICE.find((n) => n * power >= value * (1 - 1e-9));
}

/** A colour scale from zero to `max`, never less than `floor`. */
export class StickyScale {
  constructor(floor) {
    this.floor = floor;
    this.max = niceAbove(floor);
    this.#forget(0);
  }

  /** Takes the largest value of a frame at time `now` (ms); says whether `max` changed. */
  take(value, now) {
    this.recent = Math.max(this.recent, value);
    if (value > this.max) return this.#set(value, now);
    if (value > SHRINK_BELOW * this.max || this.max <= niceAbove(this.floor)) this.#forget(now);
    return now - this.since > PATIENCE_MS && this.#set(this.recent, now);
  }

  /** Fits the scale to `value` now. */
  fit(value, now) {
    this.#set(value, now);
  }

  #set(value, now) {
    const before = this.max;
    this.max = niceAbove(Math.max(this.floor, value));
    this.#forget(now);
    return this.max !== before;
  }

  #forget(now) {
    this.since = now;
    this.recent = 0;
  }
}
