// Where contacts have been a moment ago, by their numbers.

const KEPT_MS = 1400;
// Closer points are one (m); a longer step in one frame is no way but another place.
const STEP_M = 2e-4;
const JUMP_M = 6e-3;

/** Remembers the ways of contacts. */
export class Trails {
  constructor() { this.ways = new Map(); }

  /** Takes the contacts of an update. */
  take(contacts, now) {
    for (const { id, xM, yM, place } of contacts) {
      if (!id) continue;
      const way = this.ways.get(id) ?? [];
      const last = way.at(-1);
      const step = last ? Math.hypot(last.xM - xM, last.yM - yM) : Infinity;
      if (step > STEP_M) way.push({ xM, yM, place, at: now, begins: step > JUMP_M });
      this.ways.set(id, way);
    }
    for (const [id, way] of this.ways) {
      while (way.length && now - way[0].at > KEPT_MS) way.shift();
      if (!way.length) this.ways.delete(id);
    }
  }

  /** All ways: `[id, points]`, a point with `age` from 0, now, to 1, forgotten. */
  all(now) {
    return [...this.ways].map(([id, way]) => [id, way.map((point) => ({ ...point, age: Math.min(1, (now - point.at) / KEPT_MS) }))]);
  }

  clear() { this.ways.clear(); }
}
