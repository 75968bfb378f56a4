// Touch as heat: contact conductance per area (S/m2) at every pixel of the detector, from an image or from contacts. One field
// for both, so that both have the same colours on the same scale.

import { Raster } from "./raster.js";

// A contact is drawn as C / (pi r2) exp(-(d / r)2), which adds up to its conductance C; beyond so many radii that is nothing.
const REACH = 3.5;

/** Density (S/m2) in the middle of a contact of this conductance and radius. */
export const densityOf = ({ conductanceS }, radiusM) => Math.max(0, conductanceS ?? 0) / (Math.PI * radiusM * radiusM);

/** The heat of the newest update. */
export class HeatField {
  constructor(setup) {
    this.usualRadiusM = setup.usual_radius_m;
    this.bounds = setup.bounds_m;
    this.nodes = setup.nodes_m.length;
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
    this.image = image.length && image.length === this.nodes ? image : null;
    this.contacts = contacts;
    this.shape = shape;
    if (this.image) this.raster.interpolate(this.image, this.values);
    else this.#drawContacts();
    this.peak = this.image
      ? this.image.reduce((a, b) => Math.max(a, b), 0)
      : contacts.reduce((a, contact) => Math.max(a, densityOf(contact, this.radiusOf(contact))), 0);
  }

  /** Radius (m) that a contact is drawn with: its own, or a usual one. */
  radiusOf({ radiusM }) { return radiusM ?? this.usualRadiusM; }

  /** Number of the pixel at a place on the map (m). */
  pixelAt(xM, yM) {
    const [[left], [, top]] = this.bounds;
    const clamp = (i, most) => Math.min(most - 1, Math.max(0, Math.round(i)));
    const column = clamp((xM - left) / this.raster.pixelM - 0.5, this.width);
    const row = clamp((top - yM) / this.raster.pixelM - 0.5, this.height);
    return row * this.width + column;
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
