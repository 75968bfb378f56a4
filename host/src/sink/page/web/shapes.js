// The detector in space: a flat one as a sheet of foam that rises with the heat, a curved one as it is, swelling a little.

import { densityOf } from "./heat.js";

// Points along the longer side of a flat detector that has the picture for itself.
const GRID = 96;
// Height of what has the colour of the scale's end, and thickness of the sheet, as shares of the detector's longer side.
const RISE = 0.26;
const THICKNESS = 0.05;
const SWELL = 0.1;
// From this share of the scale on heights grow less, and never beyond the other: what is above the end of the scale is higher still, and not cut flat.
const [KNEE, HIGHEST] = [0.85, 1.2];
// Shares of the scale's end below which nothing rises: it would not be seen.
const SEEN = 3e-5;

/** Height of a value, as a share of that of the scale's end. */
function heightOf(value, scale) {
  const root = Math.sqrt(Math.max(0, value) / scale.max);
  return root < KNEE ? root : HIGHEST - (HIGHEST - KNEE) * Math.exp((KNEE - root) / (HIGHEST - KNEE));
}

/**
 * Whether a point is within an outline with holes: even-odd rule.
 * @param {number[][][]} loops
 * @param {number[]} place
 */
function isInside(loops, [x, y]) {
  let inside = false;
  for (const loop of loops) {
    for (let i = 0, j = loop.length - 1; i < loop.length; j = i, i += 1) {
      const [[ax, ay], [bx, by]] = [loop[i], loop[j]];
      if ((ay > y) !== (by > y) && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
    }
  }
  return inside;
}

/** Normals at points, of the triangles about them: `points` and the result x, y, z one after the other. */
export function normalsOf(points, triangles, normals) {
  normals.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
    const [ux, uy, uz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [vx, vy, vz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (let corner = 0; corner < 3; corner += 1) {
      const at = 3 * triangles[t + corner];
      normals[at] += nx;
      normals[at + 1] += ny;
      normals[at + 2] += nz;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.sqrt(normals[i] ** 2 + normals[i + 1] ** 2 + normals[i + 2] ** 2) || 1;
    normals[i] /= length;
    normals[i + 1] /= length;
    normals[i + 2] /= length;
  }
}

/** A flat detector. */
class Plate {
  pixels;

  constructor({ bounds_m: [[left, bottom], [right, top]], outline_m: loops }, grid) {
    this.sizeM = Math.max(right - left, top - bottom);
    const ends = [-THICKNESS, RISE].map((share) => share * this.sizeM);
    this.centre = [(left + right) / 2, (bottom + top) / 2, (ends[0] + ends[1]) / 2];
    /** Corners of the box that it takes up, as it rises (m). */
    this.boxM = [[left, bottom, ends[0]], [right, top, ends[1]]];
    this.radiusM = Math.hypot(right - left, top - bottom) / 2;
    this.halfHeightM = (ends[1] - ends[0]) / 2;
    // The longer side lies across the picture.
    this.turn = top - bottom > 1.5 * (right - left) ? 1.2 : right - left > 1.5 * (top - bottom) ? -0.35 : -0.6;
    const cellM = this.sizeM / grid;
    const [columns, rows] = [right - left, top - bottom].map((side) => Math.max(2, Math.round(side / cellM)));
    const at = (i, k) => k * (columns + 1) + i;
    const below = (columns + 1) * (rows + 1);
    const low = new Set();
    this.places = [];
    for (const isLow of [false, true]) {
      for (let k = 0; k <= rows; k += 1) {
        for (let i = 0; i <= columns; i += 1) {
          if (isLow) low.add(this.places.length);
          this.places.push([left + ((right - left) * i) / columns, bottom + ((top - bottom) * k) / rows]);
        }
      }
    }
    const triangles = [];
    for (let k = 0; k < rows; k += 1) {
      for (let i = 0; i < columns; i += 1) {
        const middle = [left + ((right - left) * (i + 0.5)) / columns, bottom + ((top - bottom) * (k + 0.5)) / rows];
        if (!isInside(loops, middle)) continue;
        const cell = [at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k), at(i + 1, k + 1), at(i, k + 1)];
        triangles.push(...cell, ...cell.map((corner) => below + corner).reverse());
      }
    }
    for (const loop of loops) this.#addWall(loop, cellM, low, triangles);
    this.triangles = Uint32Array.from(triangles);
    this.points = Float32Array.from(this.places.flatMap((place, i) => [...place, low.has(i) ? ends[0] : 0]));
    this.isLow = Uint8Array.from(this.places, (_, i) => (low.has(i) ? 1 : 0));
    this.shares = new Float32Array(this.places.length);
    this.space = new Uint32Array(this.triangles.length);
    /** The triangles that rise, all others being as at rest. */
    this.raised = this.space.subarray(0, 0);
    this.rimsM = loops.map((loop) => loop.map(([x, y]) => [x, y, 0]));
  }

  // The edge of the sheet along a loop of its outline: points of its own, so that the light on it is not that from above.
  #addWall(loop, cellM, low, triangles) {
    const along = loop.flatMap(([ax, ay], i) => {
      const [bx, by] = loop[(i + 1) % loop.length];
      const pieces = Math.max(1, Math.round(Math.hypot(bx - ax, by - ay) / cellM));
      return Array.from({ length: pieces }, (_, k) => [[ax, ay, bx, by], k / pieces, (k + 1) / pieces]);
    });
    for (const [[ax, ay, bx, by], from, to] of along) {
      const first = this.places.length;
      for (const share of [from, to]) {
        const place = [ax + (bx - ax) * share, ay + (by - ay) * share];
        this.places.push(place, place);
        low.add(this.places.length - 1);
      }
      triangles.push(first, first + 1, first + 3, first, first + 3, first + 2);
    }
  }

  /** Moves the points to where they are when nothing presses. */
  settle() {
    this.shares.fill(0);
    for (let i = 0; i < this.shares.length; i += 1) if (!this.isLow[i]) this.points[3 * i + 2] = 0;
  }

  /** Moves the points to the heat of now. */
  update(field, scale) {
    const { triangles, shares } = this;
    for (let i = 0; i < shares.length; i += 1) {
      if (this.isLow[i]) continue;
      const value = field.at(this.places[i][0], this.places[i][1]);
      const rises = value > SEEN * scale.max;
      shares[i] = rises ? scale.share(value) : 0;
      this.points[3 * i + 2] = rises ? RISE * this.sizeM * heightOf(value, scale) : 0;
    }
    let count = 0;
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
      if (!(shares[a] > 0 || shares[b] > 0 || shares[c] > 0)) continue;
      this.space[count] = a;
      this.space[count + 1] = b;
      this.space[count + 2] = c;
      count += 3;
    }
    this.raised = this.space.subarray(0, count);
  }

  /** The top of the heat at a contact. */
  topOf({ xM, yM }, field, scale) {
    return [xM, yM, RISE * this.sizeM * heightOf(field.at(xM, yM), scale)];
  }
}

/** A curved detector. */
class Curved {
  constructor({ places_m: places, triangles, torn_triangles: torn }) {
    const ends = [0, 1, 2].map((k) => [Math.min(...places.map((p) => p[k])), Math.max(...places.map((p) => p[k]))]);
    this.centre = ends.map(([low, high]) => (low + high) / 2);
    this.sizeM = Math.max(...ends.map(([low, high]) => high - low));
    const halves = ends.map(([low, high]) => (high - low) / 2);
    this.boxM = [-1, 1].map((sign) => this.centre.map((value, k) => value + sign * (halves[k] + SWELL * this.sizeM)));
    this.radiusM = Math.hypot(halves[0], halves[1]) + SWELL * this.sizeM;
    this.halfHeightM = halves[2] + SWELL * this.sizeM;
    this.turn = -0.6;
    this.triangles = Uint32Array.from([...triangles, ...torn].flat());
    this.raised = this.triangles;
    this.rest = Float32Array.from(places.flat());
    this.points = this.rest.slice();
    this.out = new Float32Array(this.rest.length);
    normalsOf(this.rest, this.triangles, this.out);
    this.shares = new Float32Array(places.length);
    this.rimsM = [];
  }

  /** All of it is drawn anew: a swelling changes the light around it. */
  settle() {}

  /** Moves the points to the heat of now. */
  update(field, scale) {
    for (let node = 0; node < this.shares.length; node += 1) {
      this.shares[node] = scale.share(field.image ? field.image[node] : this.#heat(field, 3 * node));
      const swell = SWELL * this.sizeM * this.shares[node];
      for (let k = 0; k < 3; k += 1) this.points[3 * node + k] = this.rest[3 * node + k] + swell * this.out[3 * node + k];
    }
  }

  // As on the map, with distances in space.
  #heat(field, at) {
    let heat = 0;
    for (const contact of field.contacts) {
      const r = field.radiusOf(contact);
      const [dx, dy, dz] = [0, 1, 2].map((k) => this.rest[at + k] - contact.place[k]);
      heat += densityOf(contact, r) * Math.exp(-(dx * dx + dy * dy + dz * dz) / (r * r));
    }
    return heat;
  }

  /** The place of a contact. */
  topOf({ place }) { return place; }
}

/**
 * The shape of a detector: `points`, `triangles`, those of them that are `raised`, `shares` of the colours, and `update(field, scale)`; a flat one with
 * `grid` points along its longer side.
 */
export const shapeOf = (setup, grid = GRID) => (setup.places_m.length ? new Curved(setup) : new Plate(setup, grid));
