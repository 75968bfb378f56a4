// How firmly each contact pressed, and all together, over the last minute.

import { valueOf } from "./strength.js";

const KEPT_MS = 61_000;
// Samples are this far apart at least: more do not fit on a screen.
const EVERY_MS = 40;

/** Samples of each contact, by its number; those of a shape, or of an image without contacts, under 0. */
export class History {
  constructor(setup) {
    this.areas = nodeAreas(setup);
    this.nodes = setup.nodes_m;
    this.clear();
  }

  clear() {
    this.lines = new Map();
    /** Of each sample: when it was by the page's clock (ms) and by the board's (s), and what all pressed with together. */
    this.turns = [];
    this.turn = 0;
    this.last = -Infinity;
    this.unit = "S";
  }

  /** Takes an update; `total` says what all of it presses with. */
  take({ contacts, timeS }, now, total) {
    const unit = contacts.some(({ forceN }) => forceN !== null) ? "N" : "S";
    if (contacts.length && unit !== this.unit) {
      // Siemens and newtons have no axis in common.
      this.clear();
      this.unit = unit;
    }
    if (now - this.last < EVERY_MS) return;
    this.last = now;
    this.turn += 1;
    const numbered = contacts.filter(({ id }) => id);
    for (const contact of numbered) this.#add(contact.id, valueOf(contact), now);
    const all = total();
    // What has no number cannot be told apart from frame to frame: all of it together.
    if (!numbered.length && all > 0) this.#add(0, all, now);
    this.turns.push({ turn: this.turn, at: now, timeS, total: all });
    while (now - this.turns[0].at > KEPT_MS) this.turns.shift();
    for (const [id, line] of this.lines) {
      while (line.length && now - line[0].at > KEPT_MS) line.shift();
      if (!line.length) this.lines.delete(id);
    }
  }

  /** What an image has at its nodes, and where they are (m). */
  partsOf(image) {
    return Array.from(image, (density, node) => ({ value: this.areas[node] * Math.max(0, density), at: this.nodes[node] }));
  }

  #add(id, value, at) {
    const line = this.lines.get(id) ?? [];
    // In turns one after the other, the contact was there in between.
    line.push({ at, value, turn: this.turn });
    this.lines.set(id, line);
  }

  /** The values at a moment: `[id, value]` of those that were there. */
  at(moment) {
    const near = (line) => line.findLast(({ at }) => at <= moment + EVERY_MS);
    return [...this.lines].map(([id, line]) => [id, near(line)])
      .filter(([, sample]) => sample && moment - sample.at < 4 * EVERY_MS + 100)
      .map(([id, sample]) => [id, sample.value]);
  }
}

// A third of each triangle belongs to each of its corners (m2).
function nodeAreas({ nodes_m: nodes, places_m: places, triangles, torn_triangles: torn }) {
  const areas = new Float64Array(nodes.length);
  const at = (node) => places[node] ?? [...nodes[node], 0];
  for (const triangle of [...triangles, ...torn]) {
    const [a, b, c] = triangle.map(at);
    const [u, v] = [b, c].map((p) => p.map((value, k) => value - a[k]));
    const area = 0.5 * Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
    for (const node of triangle) areas[node] += area / 3;
  }
  return areas;
}
