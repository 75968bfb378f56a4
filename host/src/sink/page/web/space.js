// The view in space: height is pressure.

import { middleOf } from "./bars.js";
import { Camera } from "./camera.js";
import { colourMaps } from "./colours.js";
import { drawBar } from "./frame.js";
import { sizeCanvas } from "./layout.js";
import { drawLabels, drawTrail } from "./marks.js";
import { faded } from "./palette.js";
import { normalsOf, shapeOf } from "./shapes.js";
import { DepthImage, shadesOf } from "./triangles.js";

// More pixels than this are not drawn one by one.
const MOST_PIXELS = 420_000;
// An edge is drawn in so many pieces, each of which may be hidden.
const EDGE_PIECES = 48;
const SHADES = { light: { darkest: 0.6, lift: 0 }, dark: { darkest: 0.4, lift: 34 } };

/** Draws `view.field` in space. */
export class SpaceView {
  width; height;

  constructor(view) {
    this.view = view;
    this.canvas = document.getElementById("space");
    this.marks = document.getElementById("marks");
    this.shape = shapeOf(view.setup);
    this.camera = new Camera(view.setup.places_m.length > 0);
    const count = this.shape.shares.length;
    this.normals = new Float32Array(3 * count);
    /** @type {any} */
    this.screen = { share: this.shape.shares };
    for (const name of ["x", "y", "z", "light"]) this.screen[name] = new Float32Array(count);
  }

  /** Fits into a box of pixels. */
  layOut(width, height) {
    [this.width, this.height] = [width, height];
    const ratio = Math.min(1.5, window.devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (width * height)));
    this.depth = new DepthImage(Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio)));
    [this.canvas.width, this.canvas.height] = [this.depth.width, this.depth.height];
    [this.canvas.style.width, this.canvas.style.height] = [`${width}px`, `${height}px`];
    this.over = sizeCanvas(this.marks, width, height);
  }

  /** Draws all of it. */
  draw(now) {
    const { view: { field, scale, theme }, shape, depth } = this;
    shape.update(field, scale);
    this.#project();
    depth.clear();
    if (this.theme !== theme) this.shades = shadesOf(colourMaps(theme).image, SHADES[this.theme = theme]);
    depth.draw(shape.triangles, this.screen, this.shades);
    this.canvas.getContext("2d").putImageData(depth.image, 0, 0);
    this.#drawOver(now);
  }

  #project() {
    const { shape: { points, triangles }, normals, screen, depth } = this;
    normalsOf(points, triangles, normals);
    this.camera.project(this.shape, points, screen, depth.width, depth.height);
    const [x, y, z] = this.camera.light();
    for (let i = 0, k = 0; i < screen.x.length; i += 1, k += 3) {
      const facing = normals[k] * x + normals[k + 1] * y + normals[k + 2] * z;
      screen.light[i] = 0.5 + 0.5 * facing;
    }
  }

  #drawOver(now) {
    const { over, view, shape, width, height } = this;
    const at = this.camera.projection(shape, width, height);
    over.clearRect(0, 0, width, height);
    this.#drawRims(at);
    this.#drawPads(at);
    for (const [id, way] of view.trails.all(now)) {
      const points = way.map(({ place, ...rest }) => {
        const [x, y] = at(...place);
        return { ...rest, x, y };
      });
      drawTrail(over, id, points, view.colours);
    }
    const spots = view.field.contacts.map((contact) => {
      const [x, y] = at(...shape.topOf(contact, view.field, view.scale));
      return { contact, text: view.labelOf(contact), x, y, radius: 8 };
    });
    if (view.field.shape) {
      const [xM, yM] = middleOf(view.field.shape);
      const [x, y] = at(...shape.topOf({ xM, yM, place: [xM, yM, 0] }, view.field, view.scale));
      spots.push({ contact: view.field.shape, text: view.labelOf(view.field.shape), x, y, radius: 8 });
    }
    drawLabels(over, spots, view.colours, { width, height });
    const narrow = width < 520;
    drawBar(over, { left: 0, width: width - (narrow ? 58 : 96), top: 14, height: Math.min(360, height - 44), narrow }, view);
  }

  #drawRims(at) {
    this.over.strokeStyle = faded(this.view.colours.muted, 0.7);
    this.over.lineWidth = 1;
    this.over.beginPath();
    for (const rim of this.shape.rimsM) {
      rim.forEach((corner, i) => this.#addEdge(at, corner, rim[(i + 1) % rim.length]));
    }
    this.over.stroke();
  }

  // The pieces of an edge that are not behind something.
  #addEdge(at, from, to) {
    let before = null;
    for (let i = 0; i <= EDGE_PIECES; i += 1) {
      const [x, y, z] = at(...from.map((v, k) => v + ((to[k] - v) * i) / EDGE_PIECES));
      if (before && (before.shows || this.#shows(x, y, z))) {
        this.over.moveTo(before.x, before.y);
        this.over.lineTo(x, y);
      }
      before = { x, y, shows: this.#shows(x, y, z) };
    }
  }

  #shows(x, y, z) {
    const ratio = this.depth.width / this.width;
    return this.depth.isVisible(x * ratio, y * ratio, z, 0.03 * this.shape.sizeM);
  }

  // Electrodes that are not behind something.
  #drawPads(at) {
    const { over, view } = this;
    view.setup.electrodes.forEach((pad, i) => {
      const [x, y, z] = at(...pad.place_m);
      if (!this.#shows(x, y, z)) return;
      over.beginPath();
      over.arc(x, y, 3, 0, 2 * Math.PI);
      over.fillStyle = view.excluded.includes(i) ? view.colours.bad : faded(view.colours.ink, 0.4);
      over.fill();
    });
  }
}
