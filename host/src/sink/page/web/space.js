// The view in space: height is pressure.

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
const LIGHT = [-0.45, 0.35, 0.82];
const DARKEST = { light: 0.62, dark: 0.35 };

/** Draws `view.field` in space. */
export class SpaceView {
  constructor(view) {
    this.view = view;
    this.canvas = document.getElementById("space");
    this.marks = document.getElementById("marks");
    this.shape = shapeOf(view.setup);
    this.camera = new Camera(view.setup.places_m.length > 0);
    const count = this.shape.shares.length;
    this.normals = new Float32Array(3 * count);
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
    if (this.theme !== theme) this.shades = shadesOf(colourMaps(theme).image, DARKEST[this.theme = theme]);
    depth.draw(shape.triangles, this.screen, this.shades);
    this.canvas.getContext("2d").putImageData(depth.image, 0, 0);
    this.#drawOver(now);
  }

  #project() {
    const { shape: { points, triangles }, normals, screen, depth } = this;
    normalsOf(points, triangles, normals);
    this.camera.project(this.shape, points, screen, depth.width, depth.height);
    for (let i = 0; i < screen.x.length; i += 1) {
      const k = 3 * i;
      const facing = normals[k] * LIGHT[0] + normals[k + 1] * LIGHT[1] + normals[k + 2] * LIGHT[2];
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
      return { contact, x, y, radius: 8 };
    });
    drawLabels(over, spots, view.colours, { width, height });
    const narrow = width < 520;
    drawBar(over, { left: 0, width: width - (narrow ? 58 : 96), top: 14, height: Math.min(360, height - 44), narrow }, view);
  }

  #drawRims(at) {
    this.over.strokeStyle = faded(this.view.colours.muted, 0.7);
    this.over.lineWidth = 1;
    for (const rim of this.shape.rimsM) {
      this.over.beginPath();
      rim.forEach((corner, i) => {
        const [x, y] = at(...corner);
        if (i) this.over.lineTo(x, y); else this.over.moveTo(x, y);
      });
      this.over.closePath();
      this.over.stroke();
    }
  }

  // Electrodes that are not behind something.
  #drawPads(at) {
    const { over, view, depth } = this;
    const ratio = depth.width / this.width;
    view.setup.electrodes.forEach((pad, i) => {
      const [x, y, z] = at(...pad.place_m);
      if (!depth.isVisible(x * ratio, y * ratio, z, 0.03 * this.shape.sizeM)) return;
      over.beginPath();
      over.arc(x, y, 3, 0, 2 * Math.PI);
      over.fillStyle = view.excluded.includes(i) ? view.colours.bad : faded(view.colours.ink, 0.4);
      over.fill();
    });
  }
}
