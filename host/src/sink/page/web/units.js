// Numbers as people read them.

/** @type {[number, string][]} */
const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"], [1e-12, "p"]];
const MINUS = "\u2212";

/** The SI prefix that puts `value` between 1 and 1000, as `{factor, symbol}`. */
export function prefixOf(value) {
  const size = Math.abs(value);
  const [factor, symbol] = PREFIXES.find(([f]) => size >= f * 0.9995) ?? (size > 0 ? PREFIXES.at(-1) : [1, ""]);
  return { factor, symbol };
}

// A smaller prefix takes the place of a larger one once that was too large for so long: a number that goes about a thousand keeps its unit.
const HELD_MS = 1000;

/** The prefix of a number that changes. */
export class HeldPrefix {
  held = null;
  needed = -Infinity;

  /** The one to write `value` with at time `now` (ms), as `{factor, symbol}`. */
  of(value, now) {
    const own = prefixOf(value);
    const isNeeded = !this.held || own.factor >= this.held.factor;
    if (isNeeded) this.needed = now;
    if (isNeeded || now - this.needed >= HELD_MS) this.held = own;
    return this.held;
  }
}

/** `value` with fixed decimals and a true minus sign. */
export const fixed = (value, decimals) => {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", MINUS);
};

/** Metres as millimetres, without the unit. */
export const millimetres = (metres, decimals) => fixed(metres * 1e3, decimals);

/** `value` with three significant digits, or so many, and the unit with an SI prefix, its own or that one. */
export function withPrefix(value, unit, digits = 3, { factor, symbol } = prefixOf(value)) {
  const whole = Math.floor(Math.log10(Math.max(1, Math.abs(value / factor))) + 1e-6) + 1;
  return `${fixed(value / factor, Math.max(0, digits - whole))}\u2009${symbol}${unit}`;
}

/** `value ± error` with the prefix and the decimals of the value. */
export function withError(value, error, unit, prefix = prefixOf(value)) {
  const text = withPrefix(value, unit, 3, prefix);
  if (error === null) return text;
  const decimals = /[.](\d+)/.exec(text)?.[1].length ?? 0;
  return text.replace("\u2009", ` ± ${fixed(error / prefix.factor, decimals)}\u2009`);
}

/** A count with thin spaces between thousands. */
export const count = (value) => String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, "\u2009");

/** A step of 1, 2 or 5 times a power of ten that cuts `range` into at most `most` pieces. */
export function niceStep(range, most) {
  const rough = range / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((m) => m * power >= rough * (1 - 1e-9));
}

/** Multiples of `step` from `low` to `high`. */
export function ticks(low, high, step) {
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
}

/** Decimals that show multiples of `step` apart. */
export const decimalsOf = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
