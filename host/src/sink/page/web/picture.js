// The image of the detector: colours on a canvas, and over it as SVG the outline, electrodes, contacts, axes and colour bar.

import { colourMaps, css } from "./colours.js";
import { markOf, sizeKey } from "./marks.js";
import { Raster } from "./raster.js";
import { StickyScale } from "./scale.js";
import { gradient, label, line, svg } from "./svg.js";
import { decimalsOf, fixed, niceStep, prefixOf, ticks } from "./units.js";

const MARGIN = { left: 54, right: 92, top: 14, bottom: 46 };
const BAR = { gap: 20, width: 14 };
// The colours never stretch over less than what a contact of this share of the sheet conductance shows, spread over the area
// that belongs to one electrode: what lies below is noise.
const FLOOR_SHARE = 0.004;

/** Draws the image; tells of it through `document.documentElement.dataset`. */
export class Picture {
  constructor(scene, theme) {
    this.scene = scene;
    this.theme = theme;
    this.box = document.getElementById("plot");
    this.canvas = document.getElementById("image");
    this.overlay = document.getElementById("overlay");
    const [[left, bottom], [right, top]] = scene.bounds_m;
    this.sizeM = [right - left, top - bottom];
    const areaM2 = this.sizeM[0] * this.sizeM[1] / scene.electrodes.length;
    this.scale = new StickyScale(FLOOR_SHARE * scene.sheet_conductance_s / areaM2);
    this.raster = new Raster(scene.nodes_m, scene.triangles, scene.bounds_m);
    this.flat = document.createElement("canvas");
    [this.flat.width, this.flat.height] = [this.raster.width, this.raster.height];
    this.blank = new Float32Array(scene.nodes_m.length);
    this.values = this.blank;
    this.contacts = [];
    this.excluded = [];
    this.layOut();
  }

  /** Shows an update. */
  show({ image, contacts, excluded }, now) {
    const had = this.hasImage;
    // A method that finds contacts only sends no image.
    this.values = image.length === this.values.length ? image : this.blank;
    this.contacts = contacts;
    this.largest = this.values.reduce((a, b) => Math.max(a, b), 0);
    if (this.scale.take(this.largest, now) || had !== this.hasImage) this.#drawKey();
    if (had || this.hasImage) this.#paint();
    this.#drawContacts();
    this.#crossOut(excluded);
    this.#tell();
  }

  /** Whether there is an image to show. */
  get hasImage() { return this.values !== this.blank; }

  /** Fits the colours to the image of now. */
  fit(now) {
    this.scale.fit(this.largest ?? 0, now);
    this.#drawKey();
    this.#paint();
  }

  /** Colours of another theme. */
  recolour(theme) {
    this.theme = theme;
    this.layOut();
  }

  /** Fits everything into the space there is. */
  layOut() {
    const { clientWidth, clientHeight } = this.box;
    const [width, height] = [clientWidth - MARGIN.left - MARGIN.right, clientHeight - MARGIN.top - MARGIN.bottom];
    this.perM = Math.max(1, Math.min(width / this.sizeM[0], height / this.sizeM[1]));
    this.width = this.perM * this.sizeM[0];
    this.height = this.perM * this.sizeM[1];
    this.left = MARGIN.left + Math.max(0, (width - this.width) / 2);
    this.top = MARGIN.top + Math.max(0, (height - this.height) / 2);
    this.overlay.setAttribute("viewBox", `0 0 ${clientWidth} ${clientHeight}`);
    this.#sizeCanvas();
    this.#drawScene();
    this.#paint();
  }

  /** Place on the detector (m) of a pointer event, or null off its bounds. */
  placeOf({ clientX, clientY }) {
    const box = this.box.getBoundingClientRect();
    const [x, y] = [(clientX - box.left - this.left) / this.perM, (clientY - box.top - this.top) / this.perM];
    if (x < 0 || y < 0 || x > this.sizeM[0] || y > this.sizeM[1]) return null;
    return [this.scene.bounds_m[0][0] + x, this.scene.bounds_m[1][1] - y];
  }

  /** Marks the electrodes of a reading: the grounded one and the one read. */
  highlight(g, e) {
    this.pads.forEach((pad, i) => {
      pad.classList.toggle("grounded", i === g);
      pad.classList.toggle("read", i === e && e !== g);
    });
  }

  /** Shows or hides the cursor with which the keyboard presses. */
  showCursor(place, pressing) {
    this.cursor.setAttribute("visibility", place ? "visible" : "hidden");
    if (!place) return;
    this.cursor.setAttribute("transform", this.#at(place));
    this.cursor.classList.toggle("pressing", pressing);
  }

  #x(xM) { return this.left + (xM - this.scene.bounds_m[0][0]) * this.perM; }

  #y(yM) { return this.top + (this.scene.bounds_m[1][1] - yM) * this.perM; }

  #at([xM, yM]) { return `translate(${this.#x(xM).toFixed(2)} ${this.#y(yM).toFixed(2)})`; }

  #path(loops) {
    const loop = (corners) => `M${corners.map(([x, y]) => `${this.#x(x).toFixed(2)} ${this.#y(y).toFixed(2)}`).join("L")}Z`;
    return loops.map(loop).join("");
  }

  #sizeCanvas() {
    const ratio = window.devicePixelRatio || 1;
    const { style } = this.canvas;
    [style.left, style.top] = [`${this.left}px`, `${this.top}px`];
    [style.width, style.height] = [`${this.width}px`, `${this.height}px`];
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    const clip = new Path2D();
    const perM = this.perM * ratio;
    for (const loop of this.scene.outline_m) {
      loop.forEach(([x, y], i) => {
        const [px, py] = [(x - this.scene.bounds_m[0][0]) * perM, (this.scene.bounds_m[1][1] - y) * perM];
        if (i) clip.lineTo(px, py); else clip.moveTo(px, py);
      });
      clip.closePath();
    }
    this.context = this.canvas.getContext("2d");
    this.context.clip(clip, "evenodd");
    this.context.imageSmoothingQuality = "high";
  }

  #paint() {
    const colours = colourMaps(this.theme).image;
    this.flat.getContext("2d").putImageData(this.raster.paint(this.values, this.scale.max, colours), 0, 0);
    this.context.drawImage(this.flat, 0, 0, this.canvas.width, this.canvas.height);
  }

  #drawScene() {
    this.marks = svg("g");
    this.bar = svg("g");
    this.pads = this.scene.electrodes.map((electrode, i) => this.#pad(electrode, i));
    this.cursor = svg("g", { class: "cursor", visibility: "hidden" },
      svg("circle", { r: 11 }), line(-17, 0, 17, 0, ""), line(0, -17, 0, 17, ""));
    const outline = svg("path", { d: this.#path(this.scene.outline_m), class: "outline" });
    this.overlay.replaceChildren(...this.#axes(), outline, ...this.pads, this.marks, this.cursor, this.bar);
    this.#drawKey();
    this.#drawContacts();
    this.#crossOut(this.excluded);
  }

  #pad({ x_m: x, y_m: y, radius_m: radius }, i) {
    const size = radius * this.perM;
    const beside = size < 8;
    const number = label(beside ? size + 3 : 0, beside ? 0 : 0.5, String(i), "pad-number", beside ? "start" : "middle");
    const arm = 1.25 * Math.max(size, 6);
    const cross = svg("path", { class: "cross", d: `M${-arm} ${-arm}L${arm} ${arm}M${-arm} ${arm}L${arm} ${-arm}` });
    return svg("g", { class: "pad", transform: this.#at([x, y]) }, svg("circle", { r: size }), number, cross);
  }

  #axes() {
    const [[left, bottom], [right, top]] = this.scene.bounds_m;
    const step = niceStep(Math.max(...this.sizeM), Math.max(3, Math.min(10, Math.max(this.width, this.height) / 60)));
    const decimals = decimalsOf(step * 1e3);
    const low = this.top + this.height;
    const across = ticks(left, right, step).flatMap((x) => [
      line(this.#x(x), low + 3, this.#x(x), low + 8, "tick"), label(this.#x(x), low + 20, fixed(x * 1e3, decimals), "tick-text"),
    ]);
    const up = ticks(bottom, top, step).flatMap((y) => [
      line(this.left - 8, this.#y(y), this.left - 3, this.#y(y), "tick"),
      label(this.left - 12, this.#y(y), fixed(y * 1e3, decimals), "tick-text side", "end"),
    ]);
    const titleX = label(this.left + this.width / 2, low + 38, "x (mm)", "axis-text");
    const titleY = label(0, 0, "y (mm)", "axis-text");
    titleY.setAttribute("transform", `translate(${this.left - 44} ${this.top + this.height / 2}) rotate(-90)`);
    return [...across, ...up, titleX, titleY];
  }

  // The colour bar of an image; without one, the key to the contacts' sizes.
  #drawKey() {
    if (this.hasImage) this.#drawBar();
    else this.bar.replaceChildren(...sizeKey(this.scene.sheet_conductance_s, this.left + this.width + 52, this.top, this.height));
  }

  #drawBar() {
    const x = this.left + this.width + BAR.gap;
    const { max } = this.scale;
    const { factor, symbol } = prefixOf(max);
    const step = niceStep(max, 6);
    const decimals = decimalsOf(step / factor);
    const colours = Array.from(colourMaps(this.theme).image).filter((_, i) => i % 5 === 0).map(css);
    const marks = ticks(0, max, step).flatMap((value) => {
      const y = this.top + this.height * (1 - value / max);
      return [line(x + BAR.width, y, x + BAR.width + 5, y, "tick"),
        label(x + BAR.width + 9, y, fixed(value / factor, decimals), "tick-text side", "start")];
    });
    const title = label(0, 0, `conductance per area (${symbol}S/m²)`, "axis-text");
    title.setAttribute("transform", `translate(${x + BAR.width + 50} ${this.top + this.height / 2}) rotate(90)`);
    this.bar.replaceChildren(svg("defs", {}, gradient("image-colours", colours, true)), svg("rect", {
      x, y: this.top, width: BAR.width, height: this.height, rx: 2, class: "bar", fill: "url(#image-colours)",
    }), ...marks, title);
  }

  #drawContacts() {
    const { sheet_conductance_s: sheetS } = this.scene;
    this.marks.classList.toggle("over-image", this.hasImage);
    this.marks.replaceChildren(...this.contacts.map((contact) => {
      const mark = markOf(contact, sheetS, this.perM, this.left + this.width - this.#x(contact.xM));
      mark.setAttribute("transform", this.#at([contact.xM, contact.yM]));
      return mark;
    }));
  }

  #crossOut(excluded) {
    this.excluded = excluded;
    this.pads.forEach((pad, i) => pad.classList.toggle("excluded", excluded.includes(i)));
  }

  #tell() {
    const places = this.contacts.map(({ xM, yM }) => [xM, yM].map((m) => Number((m * 1e3).toFixed(3))));
    Object.assign(document.documentElement.dataset, {
      contacts: String(this.contacts.length), placesMm: JSON.stringify(places), image: String(this.hasImage),
      scaleMaxSPerM2: String(this.scale.max),
    });
  }
}
