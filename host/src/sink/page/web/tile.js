// One of several detectors: its picture without axes, how its link fares and what touches.

import { drawOutline } from "./bars.js";
import { HeatCanvas } from "./flat.js";
import { HeatField } from "./heat.js";
import { sizeCanvas } from "./layout.js";
import { headlineOf } from "./headline.js";
import { linkOf } from "./link.js";
import { drawMark } from "./marks.js";
import { hueOf, palette } from "./palette.js";
import { scaleOf } from "./picture.js";
import { Connection } from "./protocol.js";
import { strengthOf } from "./strength.js";
import { Told } from "./told.js";
import { write } from "./words.js";

// About the outline (pixels).
const MARGIN = 8;

function make(kind, className, parent) {
  const element = document.createElement(kind);
  element.className = className;
  parent?.append(element);
  return element;
}

/**
 * The tile of the detector of this name; tells `known(tile)` when it knows its detector, `changed()` when how it fares has, `drawn(tile)` when what touches
 * may have, `shown(now)` when it is about to show something. Its colours are on the `scale` of all.
 */
export class Tile {
  isLive = false;
  isTouched = false;
  drawn = false;
  setup = null;
  waiting = null;
  update = null;
  isPlayed = false;
  recording = null;
  refused = null;
  answer = new Told();
  name; theme; told; text; colours; scale; field; heat; at; over; held; total;

  constructor([name, index], theme, told) {
    Object.assign(this, { name, theme, told });
    this.element = make("a", "tile card", null);
    this.element.href = `${name}/`;
    const head = make("span", "tile-head", this.element);
    const title = make("strong", "", head);
    make("span", `swatch ${hueOf(index + 1)}`, title);
    title.append(name);
    this.said = make("span", "muted", head);
    this.total = make("span", "tile-total", head);
    this.plot = make("span", "tile-plot", this.element);
    this.heatElement = make("canvas", "", this.plot);
    this.marksElement = make("canvas", "", this.plot);
    this.connection = new Connection({
      setup: (setup) => this.#start(setup),
      status: (status) => this.#status(status),
      update: (update) => this.#update(update),
      lost: (reason) => this.#tell({ state: "unreachable", text: reason || "The program does not answer; trying again" }),
    }, `${name}/`);
  }

  #start(setup) {
    if (this.setup) {
      if (JSON.stringify(setup) !== this.text) location.reload();
      return;
    }
    Object.assign(this, { setup, text: JSON.stringify(setup), colours: palette(), scale: this.told.scale(scaleOf(setup)), field: new HeatField(setup) });
    this.heat = new HeatCanvas(this.heatElement, this.field);
    this.layOut();
    this.told.known(this);
  }

  /** Records it from now on, or no longer. */
  record(on) {
    if (this.isLive && !this.isPlayed && on !== Boolean(this.recording)) this.connection.send({ record: on });
  }

  #status(status) {
    const { recording, refused, playing } = status;
    Object.assign(this, { recording, refused, isPlayed: playing.kind === "recording" });
    this.#tell(linkOf(status));
  }

  #tell({ state, text }) {
    const wasLive = this.isLive;
    this.isLive = state === "streaming" || state === "playing";
    if (this.isLive !== wasLive) this.told.drawn(this);
    if (!this.isLive) this.isTouched = false;
    this.element.classList.toggle("stale", !this.isLive);
    if (!this.isLive || !this.drawn) write(this.said, text);
    this.told.changed();
  }

  #update(update) {
    if (!this.waiting) requestAnimationFrame((now) => this.#show(now));
    this.waiting = update;
  }

  #show(now) {
    const update = this.waiting;
    this.waiting = null;
    if (this.setup) this.#reveal(update, now);
    this.connection.taken();
  }

  // As on its own page: one answer, drawn whole.
  #reveal(update, now) {
    const turn = this.answer.take(update, now);
    clearTimeout(this.held);
    if (turn === "held") {
      this.held = setTimeout(() => this.#reveal(update, performance.now()), this.answer.left(now));
      return;
    }
    const { contacts, shape } = update;
    this.update = update;
    this.field.take(update);
    this.told.shown(now);
    this.draw();
    const isTouched = contacts.length > 0 || shape !== null || update.image.length > 0;
    if (turn === "told") {
      write(this.said, headlineOf(update));
      write(this.total, update.total ? strengthOf(update.total) : "\u2013");
    }
    this.drawn = true;
    const wasTouched = this.isTouched;
    this.isTouched = isTouched;
    if (isTouched || wasTouched) this.told.drawn(this);
    if (isTouched !== wasTouched) this.told.changed();
  }

  /** Colours of another theme. */
  recolour(theme) {
    this.theme = theme;
    this.colours = palette();
    this.layOut();
  }

  /** Fits the picture into the tile. */
  layOut() {
    const { clientWidth: width, clientHeight: height } = this.plot;
    if (!this.setup || !width || !height) return;
    const [[left, bottom], [right, top]] = this.setup.bounds_m;
    const perM = Math.min((width - 2 * MARGIN) / (right - left), (height - 2 * MARGIN) / (top - bottom));
    const [w, h] = [perM * (right - left), perM * (top - bottom)];
    this.at = { perM, x: (xM) => (width - w) / 2 + perM * (xM - left), y: (yM) => (height - h) / 2 + perM * (top - yM) };
    Object.assign(this.heatElement.style, { width: `${w}px`, height: `${h}px`, left: `${this.at.x(left)}px`, top: `${this.at.y(top)}px` });
    this.over = sizeCanvas(this.marksElement, width, height);
    this.draw();
  }

  /** Draws it as it is now. */
  draw() {
    const { over, at, field, scale, theme, colours, setup } = this;
    if (!over) return;
    this.heat.draw(scale.max, theme);
    over.clearRect(0, 0, over.canvas.width, over.canvas.height);
    over.fillStyle = colours.muted;
    for (const { x_m: xM, y_m: yM } of setup.electrodes) {
      over.beginPath();
      over.arc(at.x(xM), at.y(yM), 2, 0, 2 * Math.PI);
      over.fill();
    }
    if (field.shape) drawOutline(over, field.shape, at, colours);
    for (const contact of field.contacts) drawMark(over, contact, [at.x(contact.xM), at.y(contact.yM)], at.perM, colours);
  }
}
