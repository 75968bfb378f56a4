// The maps of a calibration: where has been rubbed, and how well places will be known.

import { colourMaps, css } from "./colours.js";
import { sizeCanvas } from "./layout.js";

// Expected errors that the map's colours reach to (m): from where a marked place is as well known as a hand can mark it, to where a
// fingertip would be missed.
const BEST_M = 0.1e-3;
const WORST_M = 5e-3;
const GRID = 48;

/** Share of the colours for an expected error: a factor is as much wherever it is. */
export const shareOf = (errorM) => Math.min(1, Math.max(0, Math.log(errorM / BEST_M) / Math.log(WORST_M / BEST_M)));

/** A map of the detector on the canvas of this id, as wide as that is. */
class DetectorMap {
  left; bottom; right; top; outline;

  constructor(id, { bounds_m: [[left, bottom], [right, top]], outline_m: outline }) {
    this.canvas = document.getElementById(id);
    Object.assign(this, { left, bottom, right, top, outline });
  }

  /** Clears it, and clips to the outline; gives what turns places (m) into pixels. */
  begin() {
    const width = this.canvas.parentElement.clientWidth;
    const perM = width / (this.right - this.left);
    const height = Math.round(perM * (this.top - this.bottom));
    const context = sizeCanvas(this.canvas, width, height);
    const at = ([xM, yM]) => [(xM - this.left) * perM, (this.top - yM) * perM];
    context.beginPath();
    for (const loop of this.outline) {
      loop.forEach((place, i) => (i ? context.lineTo(...at(place)) : context.moveTo(...at(place))));
      context.closePath();
    }
    context.clip("evenodd");
    return { context, at, perM };
  }
}

/** Where has been rubbed: half a tone for a light press or a firm one, the whole for both. */
export class RubbedMap extends DetectorMap {
  draw({ cells: [columns, rows], felt }, theme) {
    const { context, at } = this.begin();
    const colours = colourMaps(theme).readings;
    const tones = [0.06, 0.42, 0.62, 0.85].map((share) => css(colours[Math.round(share * (colours.length - 1))]));
    const side = [(this.right - this.left) / columns, (this.top - this.bottom) / rows];
    felt.forEach((kind, cell) => {
      const [column, row] = [cell % columns, Math.floor(cell / columns)];
      const from = at([this.left + column * side[0], this.bottom + (row + 1) * side[1]]);
      const to = at([this.left + (column + 1) * side[0], this.bottom + row * side[1]]);
      context.fillStyle = tones[kind ?? 0];
      // Cells are apart by a hair, so that one sees that they are cells.
      context.fillRect(from[0] + 0.5, from[1] + 0.5, to[0] - from[0] - 1, to[1] - from[1] - 1);
    });
  }
}

/**
 * The value at a place of a regular grid of places, linear in between and as at its edge beyond it.
 * @param {Map<string, number>} places
 * @param {number[]} xs
 * @param {number[]} ys
 * @param {number[]} at
 */
function between(places, xs, ys, [xM, yM]) {
  const along = (all, value) => {
    const place = Math.min(all.length - 1, Math.max(0, ((value - all[0]) / (all.at(-1) - all[0] || 1)) * (all.length - 1)));
    const first = Math.min(Math.floor(place), Math.max(0, all.length - 2));
    return [first, Math.min(first + 1, all.length - 1), place - first];
  };
  const [[x0, x1, u], [y0, y1, v]] = [along(xs, xM), along(ys, yM)];
  const value = (x, y) => places.get(`${x},${y}`) ?? NaN;
  return (1 - v) * ((1 - u) * value(x0, y0) + u * value(x1, y0)) + v * ((1 - u) * value(x0, y1) + u * value(x1, y1));
}

/** How far off places are expected to be, all over the detector. */
export class ErrorMap extends DetectorMap {
  draw(fit, theme) {
    const { context, at } = this.begin();
    const colours = colourMaps(theme).image;
    const colourOf = (errorM) => css(colours[Math.round((0.08 + 0.84 * shareOf(errorM)) * (colours.length - 1))]);
    if (!fit) {
      context.fillStyle = css(colourMaps(theme).readings[15]);
      context.fillRect(0, 0, this.canvas.width, this.canvas.height);
      return;
    }
    const sorted = (axis) => [...new Set(fit.places_m.map((place) => place[axis]))].sort((a, b) => a - b);
    const [xs, ys] = [sorted(0), sorted(1)];
    const places = new Map(fit.places_m.map(([x, y, errorM]) => [`${xs.indexOf(x)},${ys.indexOf(y)}`, Math.log(errorM)]));
    const side = [(this.right - this.left) / GRID, (this.top - this.bottom) / GRID];
    for (let row = 0; row < GRID; row += 1) {
      for (let column = 0; column < GRID; column += 1) {
        const middle = [this.left + (column + 0.5) * side[0], this.bottom + (row + 0.5) * side[1]];
        const value = between(places, xs, ys, middle);
        if (Number.isNaN(value)) continue;
        const [x, y] = at([middle[0] - side[0] / 2, middle[1] + side[1] / 2]);
        const [right, down] = at([middle[0] + side[0] / 2, middle[1] - side[1] / 2]);
        context.fillStyle = colourOf(Math.exp(value));
        context.fillRect(x, y, right - x + 0.6, down - y + 0.6);
      }
    }
  }

  /** Colours of the legend, from the best to the worst. */
  static legend(theme) {
    const colours = colourMaps(theme).image;
    const stops = Array.from({ length: 9 }, (_, i) => css(colours[Math.round((0.08 + 0.84 * (i / 8)) * (colours.length - 1))]));
    return `linear-gradient(90deg, ${stops.join(", ")})`;
  }
}
