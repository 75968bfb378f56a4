// The detector in space: a flat one as a grid that rises with the heat, a curved one as it is, swelling a little.

import { densityOf } from "./heat.js";

// Points along the longer side of a flat detector.
const GRID = 96;
// Height of the hottest place, as a share of the detector's longer side.
const RISE = 0.26;
const SWELL = 0.1;
// Share of the picture that the size takes: a plate lies, a curved detector may stand.
const FILL = { plate: 0.64, curved: 0.5 };

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
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    normals[i] /= length;
    normals[i + 1] /= length;
    normals[i + 2] /= length;
  }
}

/** A flat detector. */
class Plate {
  pixels;

  constructor({ bounds_m: [[left, bottom], [right, top]], outline_m: loops }) {
    this.sizeM = Math.max(right - left, top - bottom);
    this.fill = FILL.plate;
    this.centre = [(left + right) / 2, (bottom + top) / 2, 0.06 * this.sizeM];
    const cellM = this.sizeM / GRID;
    const [columns, rows] = [right - left, top - bottom].map((side) => Math.max(2, Math.round(side / cellM)));
    const at = (i, k) => k * (columns + 1) + i;
    this.places = [];
    for (let k = 0; k <= rows; k += 1) {
      for (let i = 0; i <= columns; i += 1) this.places.push([left + ((right - left) * i) / columns, bottom + ((top - bottom) * k) / rows]);
    }
    const triangles = [];
    for (let k = 0; k < rows; k += 1) {
      for (let i = 0; i < columns; i += 1) {
        const middle = [left + ((right - left) * (i + 0.5)) / columns, bottom + ((top - bottom) * (k + 0.5)) / rows];
        if (!isInside(loops, middle)) continue;
        triangles.push(at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k), at(i + 1, k + 1), at(i, k + 1));
      }
    }
    this.triangles = Uint32Array.from(triangles);
    this.points = Float32Array.from(this.places.flatMap((place) => [...place, 0]));
    this.shares = new Float32Array(this.places.length);
    this.rimsM = loops.map((loop) => loop.map(([x, y]) => [x, y, 0]));
  }

  /** Moves the points to the heat of now. */
  update(field, scale) {
    this.pixels ??= Uint32Array.from(this.places, ([x, y]) => field.pixelAt(x, y));
    for (let i = 0; i < this.shares.length; i += 1) {
      this.shares[i] = scale.share(field.values[this.pixels[i]]);
      this.points[3 * i + 2] = RISE * this.sizeM * this.shares[i];
    }
  }

  /** The top of the heat at a contact. */
  topOf({ xM, yM }, field, scale) {
    return [xM, yM, RISE * this.sizeM * scale.share(field.values[field.pixelAt(xM, yM)])];
  }
}

/** A curved detector. */
class Curved {
  constructor({ places_m: places, triangles, torn_triangles: torn }) {
    const ends = [0, 1, 2].map((k) => [Math.min(...places.map((p) => p[k])), Math.max(...places.map((p) => p[k]))]);
    this.centre = ends.map(([low, high]) => (low + high) / 2);
    this.fill = FILL.curved;
    this.sizeM = Math.max(...ends.map(([low, high]) => high - low));
    this.triangles = Uint32Array.from([...triangles, ...torn].flat());
    this.rest = Float32Array.from(places.flat());
    this.points = this.rest.slice();
    this.out = new Float32Array(this.rest.length);
    normalsOf(this.rest, this.triangles, this.out);
    this.shares = new Float32Array(places.length);
    this.rimsM = [];
  }

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

/** The shape of a detector: `points`, `triangles`, `shares` of the colours, and `update(field, scale)`. */
export const shapeOf = (setup) => (setup.places_m.length ? new Curved(setup) : new Plate(setup));
