// The view in space: height is pressure.

import { middleOf } from "./bars.js";
import { Camera } from "./camera.js";
import { drawBar, FrameCanvas } from "./frame.js";
import { sizeCanvas } from "./layout.js";
import { drawLabels, drawTrail } from "./marks.js";
import { faded } from "./palette.js";
import { shapeOf } from "./shapes.js";
import { heatShades, Solid } from "./solid.js";
import { DepthImage } from "./triangles.js";

// More pixels than this are not drawn one by one.
const MOST_PIXELS = 420_000;
// An edge is drawn in so many pieces, each of which may be hidden.
const EDGE_PIECES = 48;
// Pixels at the right that belong to the colour bar.
const BAR = { width: 96, narrow: 58, narrowBelow: 520 };

/** Draws `view.field` in space. */
export class SpaceView {
  width; height;

  constructor(view) {
    this.view = view;
    this.canvas = document.getElementById("space");
    this.frame = new FrameCanvas();
    this.marks = document.getElementById("marks");
    this.shape = shapeOf(view.setup);
    this.solid = new Solid(this.shape);
    this.camera = new Camera(this.shape);
  }

  /** Fits into a box of pixels. */
  layOut(width, height) {
    this.narrow = width < BAR.narrowBelow;
    this.bar = this.narrow ? BAR.narrow : BAR.width;
    width -= this.bar;
    [this.width, this.height] = [width, height];
    const ratio = Math.min(1.5, window.devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (width * height)));
    this.depth = new DepthImage(Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio)));
    [this.canvas.width, this.canvas.height] = [this.depth.width, this.depth.height];
    [this.canvas.style.width, this.canvas.style.height] = [`${width}px`, `${height}px`];
    this.frame.layOut(width + this.bar, height);
    this.over = sizeCanvas(this.marks, width + this.bar, height);
  }

  /** Draws all of it. */
  draw(now) {
    const { view: { field, scale }, shape, solid, depth } = this;
    this.#drawRest();
    solid.update(field, scale);
    depth.restore();
    solid.drawRaised(this.camera, shape, depth, this.shades);
    this.canvas.getContext("2d").putImageData(depth.image, 0, 0);
    this.#drawOver(now);
  }

  // The detector on which nothing presses: drawn once for each look at it. What rises is drawn over it.
  #drawRest() {
    const { view: { theme }, shape, depth, camera } = this;
    const look = [theme, depth.width, depth.height, camera.turn, camera.tilt, camera.zoom].join();
    if (look === this.look) return;
    this.look = look;
    this.shades = heatShades(theme);
    depth.clear();
    this.solid.drawRest(camera, shape, depth, this.shades);
    depth.keep();
  }

  #drawOver(now) {
    const { over, view, shape, width, height } = this;
    const bar = { left: 0, width, top: 14, height: Math.min(360, height - 44), narrow: this.narrow };
    this.frame.draw([view.theme, view.scale.max], (context) => drawBar(context, bar, view));
    const at = this.camera.projection(shape, width, height);
    over.clearRect(0, 0, width + this.bar, height);
    this.#drawRims(at);
    this.#drawPads(at);
    for (const [id, way] of view.trails.all(now)) {
      const points = way.map(({ place, ...rest }) => {
        const [x, y, z] = at(...place);
        return { ...rest, x, y, begins: rest.begins || !this.#shows(x, y, z) };
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
  }

  #drawRims(at) {
    this.over.strokeStyle = faded(this.view.colours.muted, 0.7);
    this.over.lineWidth = 1;
    this.solid.drawRims(this.over, at, (x, y, z) => this.#shows(x, y, z), EDGE_PIECES);
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
