// The picture of the touch: takes updates and shows them flat or in space.

import { FlatView } from "./flat.js";
import { HeatField, densityOf } from "./heat.js";
import { palette } from "./palette.js";
import { SteadyScale } from "./scale.js";
import { SpaceView } from "./space.js";
import { strengthOf } from "./strength.js";
import { Trails } from "./trails.js";

// Shares of the sheet conductance. Colours never stretch over less than what a contact of the first shows, spread over the area
// that belongs to one electrode: what lies below is noise. They begin with what a contact of the second shows, pressed firmly.
const FLOOR_SHARE = 0.004;
const FIRM_SHARE = 0.3;

/** The scale of a detector's colours, before anything touches. */
export function scaleOf(setup) {
  const [[left, bottom], [right, top]] = setup.bounds_m;
  const areaM2 = ((right - left) * (top - bottom)) / setup.electrodes.length;
  const firm = densityOf({ apparentS: null, conductanceS: FIRM_SHARE * setup.sheet_conductance_s }, setup.usual_radius_m);
  return new SteadyScale((FLOOR_SHARE * setup.sheet_conductance_s) / areaM2, firm);
}

/** Draws the touch; tells of it through `document.documentElement.dataset`. */
export class Picture {
  constructor(setup, theme, told) {
    this.setup = setup;
    this.told = told;
    this.theme = theme;
    this.colours = palette();
    this.box = document.getElementById("plot");
    this.field = new HeatField(setup);
    this.trails = new Trails();
    this.scale = scaleOf(setup);
    this.excluded = [];
    this.empty = null;
    this.marked = null;
    this.fingers = [];
    this.target = null;
    this.views = { flat: new FlatView(this), space: new SpaceView(this) };
    this.#listen();
    this.look("flat");
  }

  /** Shows an update. */
  show({ image, contacts, shape, excluded }, now) {
    this.field.take({ image, contacts, shape });
    this.trails.take(contacts, now);
    this.excluded = excluded;
    if (this.unfitted) this.scale.fit(this.field.peak, now);
    else this.scale.take(this.field.peak, now);
    this.unfitted = false;
    if (!this.#isStill()) this.draw(now);
    this.#tell();
  }

  // Whether nothing touches, as in the picture that is there.
  #isStill() {
    const { field, trails } = this;
    const isEmpty = !field.contacts.length && !field.shape && !field.image && !trails.ways.size;
    const before = this.empty;
    this.empty = isEmpty ? `${this.scale.max} ${this.excluded}` : null;
    return isEmpty && this.empty === before;
  }

  /** Fits the colours to what is there now. */
  fit(now) {
    this.scale.fit(this.field.peak, now);
    this.draw(now);
  }

  /** Ends the colours at `max` (S/m2); if that is null, they follow again what is there. */
  endAt(max, now) {
    const follows = this.scale.isFixed && max === null;
    this.scale.fix(max);
    if (follows) this.fit(now);
    else this.draw(now);
  }

  /** Fits the colours to the next update: another solver's values can be far from these. */
  fitNext() { this.unfitted = true; }

  /** Looks at it `flat` or in `space`. */
  look(name) {
    this.looking = name;
    document.getElementById("image").hidden = name !== "flat";
    document.getElementById("space").hidden = name !== "space";
    document.documentElement.dataset.view = name;
    this.layOut();
  }

  /** Colours of another theme. */
  recolour(theme) {
    this.theme = theme;
    this.colours = palette();
    this.layOut();
  }

  /** Fits everything into the space there is. */
  layOut() {
    const { clientWidth: width, clientHeight: height } = this.box;
    if (!width || !height) return;
    this.views[this.looking].layOut(width, height);
    this.draw(performance.now());
  }

  /** Draws it as it is now. */
  draw(now) {
    const begin = performance.now();
    this.views[this.looking].draw(now);
    document.documentElement.dataset.drawMs = (performance.now() - begin).toFixed(1);
  }

  /** Marks the electrodes of a reading: the grounded one and the one read. */
  highlight(g, e) {
    this.marked = g === undefined ? null : { g, e };
    this.draw(performance.now());
  }

  /** Shows where the person presses: fingers with a `place` (m), `down` or about to be. */
  showFingers(fingers) {
    this.fingers = fingers;
    this.draw(performance.now());
  }

  /** Shows where to press next, or nothing. */
  aim(target) {
    // Every status says it, and it changes once in a few seconds.
    if (JSON.stringify(target) === JSON.stringify(this.target)) return;
    this.target = target;
    this.draw(performance.now());
  }

  /** Place on the detector (m) of a pointer event, or null off its bounds and in space. */
  placeOf({ clientX, clientY }) {
    if (this.looking !== "flat") return null;
    const box = this.box.getBoundingClientRect();
    return this.views.flat.layout.placeOf(clientX - box.left, clientY - box.top);
  }

  /** What the label of a contact says, or of a shape. */
  labelOf(contact) { return strengthOf(contact.kind ? this.told.shapeOf(contact) : this.told.contactOf(contact)); }

  /** The canvases of the view, lowest first. */
  layers() {
    return [this.looking === "flat" ? "image" : "space", "frame", "marks"].map((id) => document.getElementById(id));
  }

  #listen() {
    this.views.space.camera.listen(this.box, () => this.looking === "space", () => this.draw(performance.now()));
  }

  #tell() {
    const { contacts, shape } = this.field;
    const labels = [...contacts, ...(shape ? [shape] : [])].map((contact) => this.labelOf(contact));
    const places = contacts.map(({ xM, yM }) => [xM, yM].map((m) => Number((m * 1e3).toFixed(3))));
    Object.assign(document.documentElement.dataset, {
      contacts: String(contacts.length), placesMm: JSON.stringify(places), labels: JSON.stringify(labels), image: String(Boolean(this.field.image)), shape: shape?.kind ?? "",
      scaleMaxSPerM2: String(this.scale.max), scaleFixed: String(this.scale.isFixed), excluded: this.excluded.join(" "),
    });
  }
}
