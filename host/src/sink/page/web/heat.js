// Touch as heat: contact conductance per area (S/m2) at every pixel of the detector, from an image, a shape or contacts. One field
// for all, so that all have the same colours on the same scale.

import { Raster } from "./raster.js";
import { conductanceOf } from "./strength.js";

// A contact is drawn as C / (pi r2) exp(-(d / r)2), which adds up to its conductance C; beyond so many radii that is nothing.
const REACH = 3.5;

// A line or a ring is drawn as exp(-(d / h)4) of the distance d from its middle, h half its width: even inside, smooth at its edge. The integrals of that
// over all d, and over a plane about a point, in units of h and h2.
const [ACROSS, ABOUT] = [1.8128, 2.7842];
const SHAPE_REACH = 1.9;

/** Density (S/m2) in the middle of a contact of this radius. */
export const densityOf = (contact, radiusM) => Math.max(0, conductanceOf(contact) ?? 0) / (Math.PI * radiusM * radiusM);

// A line from end to end, whose ends are as round as it is wide.
function lineOf({ from: [ax, ay], to: [bx, by] }, h) {
  const length = Math.hypot(bx - ax, by - ay) || 1e-9;
  const [ux, uy] = [(bx - ax) / length, (by - ay) / length];
  const straight = Math.max(0, length - 2 * h);
  const [mx, my] = [(ax + bx) / 2, (ay + by) / 2];
  const reach = SHAPE_REACH * h;
  return {
    areaM2: ACROSS * h * straight + ABOUT * h * h,
    distanceM: (x, y) => {
      const [dx, dy] = [x - mx, y - my];
      const along = Math.max(0, Math.abs(dx * ux + dy * uy) - straight / 2);
      return Math.hypot(along, dx * uy - dy * ux);
    },
    bounds: [[Math.min(ax, bx) - reach, Math.min(ay, by) - reach], [Math.max(ax, bx) + reach, Math.max(ay, by) + reach]],
  };
}

function ringOf({ centre: [cx, cy], radiusM }, h) {
  const reach = radiusM + SHAPE_REACH * h;
  return {
    areaM2: ACROSS * h * 2 * Math.PI * radiusM,
    distanceM: (x, y) => Math.abs(Math.hypot(x - cx, y - cy) - radiusM),
    bounds: [[cx - reach, cy - reach], [cx + reach, cy + reach]],
  };
}

// The nodes about each: those of node `n` are `others` from `first[n]` to before `first[n + 1]`.
function neighboursOf({ nodes_m: nodes, triangles, torn_triangles: torn }) {
  const about = nodes.map(() => new Set());
  for (const triangle of [...triangles, ...torn]) {
    for (const node of triangle) for (const other of triangle) if (other !== node) about[node].add(other);
  }
  const first = new Uint32Array(nodes.length + 1);
  about.forEach((others, node) => { first[node + 1] = first[node] + others.size; });
  return { first, others: Uint32Array.from(about.flatMap((others) => [...others])) };
}

/** The heat of the newest update. */
export class HeatField {
  constructor(setup) {
    this.usualRadiusM = setup.usual_radius_m;
    this.bounds = setup.bounds_m;
    this.nodes = setup.nodes_m.length;
    this.curved = setup.places_m.length > 0;
    this.around = neighboursOf(setup);
    this.smoothed = new Float32Array(this.nodes);
    this.raster = new Raster(setup.nodes_m, setup.triangles, setup.bounds_m);
    this.width = this.raster.width;
    this.height = this.raster.height;
    this.values = new Float32Array(this.width * this.height);
    this.contacts = [];
    this.shape = null;
    this.image = null;
    this.peak = 0;
  }

  /** Takes an update. Contacts that come with an image stand for what it shows: they are not drawn again. */
  take({ image, contacts, shape }) {
    this.contacts = contacts;
    this.shape = shape;
    // On a curved detector distances on the map are not those of the shape: there it is its image.
    const isDrawn = shape && !this.curved;
    this.image = !isDrawn && image.length && image.length === this.nodes ? this.#smooth(image) : null;
    if (isDrawn) this.peak = this.#drawShape(shape);
    else if (this.image) {
      this.raster.interpolate(this.image, this.values);
      this.peak = this.image.reduce((a, b) => Math.max(a, b), 0);
    } else {
      this.#drawContacts();
      this.peak = contacts.reduce((a, contact) => Math.max(a, densityOf(contact, this.radiusOf(contact))), 0);
    }
  }

  // Half of each node, half of the mean of those about it: an image tells nothing as fine as the triangles of its mesh.
  #smooth(image) {
    const { first, others } = this.around;
    for (let node = 0; node < this.nodes; node += 1) {
      const [from, to] = [first[node], first[node + 1]];
      let sum = 0;
      for (let i = from; i < to; i += 1) sum += image[others[i]];
      this.smoothed[node] = to > from ? 0.5 * image[node] + (0.5 * sum) / (to - from) : image[node];
    }
    return this.smoothed;
  }

  // Its density in the middle (S/m2).
  #drawShape(shape) {
    const h = Math.max(shape.widthM / 2, this.raster.pixelM);
    const { areaM2, distanceM, bounds } = shape.kind === "line" ? lineOf(shape, h) : ringOf(shape, h);
    const density = Math.max(0, shape.conductanceS ?? 0) / areaM2;
    const { width, height, values, raster: { pixelM } } = this;
    const [[left], [, top]] = this.bounds;
    const [[lowX, lowY], [highX, highY]] = bounds;
    const [first, last] = [Math.max(0, Math.ceil((lowX - left) / pixelM - 0.5)), Math.min(width - 1, Math.floor((highX - left) / pixelM - 0.5))];
    const [above, below] = [Math.max(0, Math.ceil((top - highY) / pixelM - 0.5)), Math.min(height - 1, Math.floor((top - lowY) / pixelM - 0.5))];
    values.fill(0);
    for (let row = above; row <= below; row += 1) {
      const yM = top - (row + 0.5) * pixelM;
      for (let column = first; column <= last; column += 1) {
        const d = distanceM(left + (column + 0.5) * pixelM, yM) / h;
        if (d < SHAPE_REACH) values[row * width + column] = density * Math.exp(-(d * d * d * d));
      }
    }
    return density;
  }

  /** Radius (m) that a contact is drawn with: its own, or a usual one. */
  radiusOf({ radiusM }) { return radiusM ?? this.usualRadiusM; }

  /** Whether a pixel is on the detector. */
  isOn(pixel) { return this.raster.corners[3 * pixel] >= 0; }

  /** The heat at a place on the map (m), between the pixels about it. */
  at(xM, yM) {
    const { width, height, values, raster: { pixelM } } = this;
    const [[left], [, top]] = this.bounds;
    const x = Math.min(width - 1, Math.max(0, (xM - left) / pixelM - 0.5));
    const y = Math.min(height - 1, Math.max(0, (top - yM) / pixelM - 0.5));
    const [column, row] = [Math.min(width - 2, Math.floor(x)), Math.min(height - 2, Math.floor(y))];
    const [fx, fy] = [x - column, y - row];
    const from = row * width + column;
    const upper = values[from] + fx * (values[from + 1] - values[from]);
    const lower = values[from + width] + fx * (values[from + width + 1] - values[from + width]);
    return upper + fy * (lower - upper);
  }

  #drawContacts() {
    this.values.fill(0);
    for (const contact of this.contacts) this.#drawContact(contact);
  }

  #drawContact(contact) {
    const { width, height, values, raster: { pixelM } } = this;
    const [[left], [, top]] = this.bounds;
    const r = this.radiusOf(contact) / pixelM;
    const density = densityOf(contact, this.radiusOf(contact));
    const [x, y] = [(contact.xM - left) / pixelM - 0.5, (top - contact.yM) / pixelM - 0.5];
    const [low, high] = [Math.max(0, Math.ceil(y - REACH * r)), Math.min(height - 1, Math.floor(y + REACH * r))];
    const [first, last] = [Math.max(0, Math.ceil(x - REACH * r)), Math.min(width - 1, Math.floor(x + REACH * r))];
    // The exponential of a sum is a product: one for rows, one for columns.
    const across = Float32Array.from({ length: Math.max(0, last - first + 1) }, (_, i) => Math.exp(-(((first + i - x) / r) ** 2)));
    for (let row = low; row <= high; row += 1) {
      const factor = density * Math.exp(-(((row - y) / r) ** 2));
      for (let i = 0; i < across.length; i += 1) values[row * width + first + i] += factor * across[i];
    }
  }
}
