// The view of a body: each detector at its place in space, with what touches it. Each opens its page.

import { Camera } from "./camera.js";
import { sizeCanvas } from "./layout.js";
import { drawDot } from "./marks.js";
import { faded, palette } from "./palette.js";
import { shapeOf } from "./shapes.js";
import { heatShades, Solid } from "./solid.js";
import { DepthImage, depthAt } from "./triangles.js";

// Points along the longer side of each detector: it is small in the picture.
const GRID = 40;
const EDGE_PIECES = 12;
const MOST_PIXELS = 420_000;
// Shortest time between two pictures (ms), so that a processor of two cores has time for eight boards.
const EVERY = 33;
// Farther than this a press is no click (pixels).
const STILL = 4;
// The body's axes in a corner: their length, how far their names are from their ends, and they from the edges (pixels).
const AXES = { length: 26, name: 9, margin: 46 };
// Between a detector and its name (pixels).
const GAP = 6;
// What is seen of a detector whose board is not there.
const NOTHING = { contacts: [], image: null, at: () => 0 };
// Seen from a little to the left, x to the right and y away.
const LOOK = { turn: -0.3, tilt: 0.85 };

/** What the camera looks at: a body of all `points` (m). */
function sceneOf(points) {
  const ends = [0, 1, 2].map((k) => [Math.min(...points.map((p) => p[k])), Math.max(...points.map((p) => p[k]))]);
  const halves = ends.map(([low, high]) => (high - low) / 2);
  return {
    centre: ends.map(([low, high]) => (low + high) / 2),
    sizeM: 2 * Math.max(...halves),
    radiusM: Math.hypot(halves[0], halves[1]),
    halfHeightM: halves[2],
  };
}

/** The corners of the box that a solid takes up, as it rises (m). */
function cornersOf(solid) {
  const pick = [0, 1];
  const { boxM } = solid.shape;
  return pick.flatMap((i) => pick.flatMap((j) => pick.map((k) => solid.at([boxM[i][0], boxM[j][1], boxM[k][2]]))));
}

/** Shows tiles whose detectors have a place. */
export class BodyView {
  parts = [];
  camera = new Camera(LOOK, -Math.PI / 2);
  drawnAt = 0;
  asked = false;
  look = "";
  scene; depth; over; shades; width; height;

  constructor(theme) {
    this.theme = theme;
    this.colours = palette();
    this.card = document.getElementById("body");
    this.plot = document.getElementById("body-plot");
    this.names = document.getElementById("body-names");
    this.space = /** @type {HTMLCanvasElement} */ (document.getElementById("body-space"));
    this.marks = /** @type {HTMLCanvasElement} */ (document.getElementById("body-marks"));
    this.#listen();
  }

  /** Adds a tile that has come to know its detector; returns whether that has a place. */
  add(tile) {
    const { setup, name } = tile;
    if (!setup.place) return false;
    const solid = new Solid(shapeOf(setup, GRID), setup.place);
    const label = document.createElement("a");
    Object.assign(label, { href: `${name}/`, textContent: name });
    this.parts.push({ tile, solid, label, isFresh: true });
    this.parts.sort((a, b) => (a.tile.name < b.tile.name ? -1 : 1));
    this.names.replaceChildren(...this.parts.map((part) => part.label));
    this.scene = sceneOf(this.parts.flatMap((part) => cornersOf(part.solid)));
    this.card.hidden = false;
    this.layOut();
    return true;
  }

  /** Takes note of what a tile shows now. */
  take(tile) {
    const part = this.parts.find((other) => other.tile === tile);
    if (!part) return;
    part.isFresh = true;
    this.#ask();
  }

  /** Colours of another theme. */
  recolour(theme) {
    this.theme = theme;
    this.colours = palette();
    this.#ask();
  }

  /** Fits it into the page. */
  layOut() {
    const { clientWidth: width, clientHeight: height } = this.plot;
    if (!this.scene || !width || !height) return;
    [this.width, this.height] = [width, height];
    const ratio = Math.min(1.5, window.devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (width * height)));
    this.depth = new DepthImage(Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio)));
    [this.space.width, this.space.height] = [this.depth.width, this.depth.height];
    this.over = sizeCanvas(this.marks, width, height);
    this.look = "";
    this.#ask();
  }

  // Draws it soon, however often that is asked.
  #ask() {
    if (this.asked) return;
    this.asked = true;
    setTimeout(() => requestAnimationFrame(() => {
      this.asked = false;
      this.drawnAt = performance.now();
      this.#draw();
    }), Math.max(0, this.drawnAt + EVERY - performance.now()));
  }

  #draw() {
    const { depth, camera, scene, parts } = this;
    if (!depth) return;
    this.#drawRest();
    for (const part of parts.filter(({ isFresh }) => isFresh)) {
      part.solid.update(part.tile.isLive ? part.tile.field : NOTHING, part.tile.scale);
      part.isFresh = false;
    }
    depth.restore();
    for (const { solid } of parts) solid.drawRaised(camera, scene, depth, this.shades);
    this.space.getContext("2d").putImageData(depth.image, 0, 0);
    this.#drawOver();
  }

  // All on which nothing presses, and names: once for each look at it.
  #drawRest() {
    const { theme, depth, camera, parts, scene } = this;
    const look = [theme, this.width, this.height, depth.width, camera.turn, camera.tilt, camera.zoom].join();
    if (look === this.look) return;
    this.look = look;
    this.shades = heatShades(theme);
    depth.clear();
    for (const part of parts) {
      part.solid.drawRest(camera, scene, depth, this.shades);
      part.isFresh = true;
    }
    depth.keep();
    this.#placeNames();
  }

  #drawOver() {
    const { over, colours, depth, width, height, camera, scene } = this;
    const ratio = depth.width / width;
    const at = camera.projection(scene, width, height);
    over.clearRect(0, 0, width, height);
    for (const part of this.parts) {
      const { solid, tile } = part;
      const slack = 0.03 * solid.shape.sizeM;
      const shows = (x, y, z) => depth.isVisible(x * ratio, y * ratio, z, slack);
      over.strokeStyle = part === this.pointed ? colours.accent : faded(colours.muted, 0.7);
      over.lineWidth = part === this.pointed ? 2 : 1;
      solid.drawRims(over, at, shows, EDGE_PIECES);
      for (const contact of tile.isLive ? tile.field.contacts : []) {
        const [x, y, z] = at(...solid.at(solid.shape.topOf(contact, tile.field, tile.scale)));
        if (shows(x, y, z)) drawDot(over, contact, [x, y], colours);
      }
      part.label.classList.toggle("touched", tile.isTouched);
      part.label.classList.toggle("stale", !tile.isLive);
    }
    this.#drawAxes();
  }

  // Which way the body's x, y and z point: those that point away are behind the others.
  #drawAxes() {
    const { over, colours, camera } = this;
    const [x, y] = [AXES.margin, this.height - AXES.margin];
    const axes = ["x", "y", "z"].map((name, k) => {
      const [right, down, away] = camera.direction([0, 1, 2].map((axis) => (axis === k ? 1 : 0)));
      return { name, right, down, away, colour: [colours.bad, colours.good, colours.hue(1)][k] };
    });
    over.font = "600 12px system-ui, sans-serif";
    [over.textAlign, over.textBaseline, over.lineWidth] = ["center", "middle", 2];
    for (const { name, right, down, colour } of axes.sort((a, b) => b.away - a.away)) {
      [over.strokeStyle, over.fillStyle] = [colour, colour];
      const end = AXES.length + AXES.name / Math.max(0.4, Math.hypot(right, down));
      over.beginPath();
      over.moveTo(x, y);
      over.lineTo(x + AXES.length * right, y + AXES.length * down);
      over.stroke();
      over.fillText(name, x + end * right, y + end * down);
    }
  }

  // Names at the outer ends of their detectors, as seen from the middle of the body, where no other name is.
  #placeNames() {
    const at = this.camera.projection(this.scene, this.width, this.height);
    const [cx, cy] = at(...this.scene.centre);
    const taken = [];
    for (const { solid, label } of this.parts) {
      const corners = solid.rimsM[0] ?? cornersOf(solid);
      const sides = corners.map((corner, i) => corners[(i + 1) % corners.length].map((value, k) => (value + corner[k]) / 2));
      const away = ([x, y]) => Math.hypot(x - cx, y - cy);
      const [x, y] = sides.map((side) => at(...side)).reduce((a, b) => (away(b) > away(a) ? b : a));
      const { offsetWidth: width, offsetHeight: height } = label;
      const length = away([x, y]) || 1;
      const [ux, uy] = [(x - cx) / length, (y - cy) / length];
      const name = { left: x + ux * (GAP + width / 2) - width / 2, top: y + uy * (GAP + height / 2) - height / 2, width };
      const isTaken = (other) => Math.abs(other.top - name.top) < height && other.left < name.left + width && name.left < other.left + other.width;
      while (taken.some(isTaken)) name.top += uy < 0 ? -GAP : GAP;
      name.left = Math.min(this.width - width, Math.max(0, name.left));
      name.top = Math.min(this.height - height, Math.max(0, name.top));
      taken.push(name);
      label.style.transform = `translate(${Math.round(name.left)}px, ${Math.round(name.top)}px)`;
    }
  }

  // The part at the pixels of an event, if there is one.
  #partAt({ clientX, clientY }) {
    if (!this.depth) return null;
    const box = this.plot.getBoundingClientRect();
    const ratio = this.depth.width / this.width;
    const [x, y] = [(clientX - box.left) * ratio, (clientY - box.top) * ratio];
    const found = this.parts.map((part) => ({ part, depth: depthAt(part.solid.shape.triangles, part.solid.screen, x, y) }));
    const { part, depth } = found.reduce((a, b) => (b.depth < a.depth ? b : a), { part: null, depth: Infinity });
    return depth < Infinity ? part : null;
  }

  #point(part) {
    if (part === this.pointed) return;
    this.pointed = part;
    this.plot.style.cursor = part ? "pointer" : "";
    for (const other of this.parts) other.label.classList.toggle("pointed", other === part);
    this.#ask();
  }

  #listen() {
    const { plot, camera } = this;
    let begun = null;
    camera.listen(plot, () => true, () => this.#ask());
    plot.addEventListener("keydown", (event) => {
      if (!camera.press(event)) return;
      event.preventDefault();
      this.#ask();
    });
    plot.addEventListener("pointerdown", ({ clientX, clientY }) => { begun = [clientX, clientY]; });
    plot.addEventListener("pointermove", (event) => this.#point(event.buttons ? this.pointed : this.#partAt(event)));
    plot.addEventListener("pointerleave", () => this.#point(null));
    plot.addEventListener("click", (event) => {
      const part = this.#partAt(event);
      const moved = begun ? Math.hypot(event.clientX - begun[0], event.clientY - begun[1]) : 0;
      if (part && moved <= STILL) location.href = part.label.href;
    });
    this.names.addEventListener("pointerover", ({ target }) => this.#point(this.parts.find((part) => part.label === target) ?? null));
    document.getElementById("body-reset").onclick = () => {
      camera.reset();
      this.#ask();
    };
  }
}
