// A screen with a cursor that a contact moves and clicks, as a mouse would.

import { sizeCanvas } from "./layout.js";
import { faded, palette } from "./palette.js";
import { count } from "./units.js";

const SCREEN = 9 / 16;
const TRAIL_MS = 2500;
const CLICK_MS = 2500;
// From the tip, clockwise.
const ARROW = [[0, 0], [0, 16], [3.8, 12.4], [6.2, 18], [8.8, 16.9], [6.4, 11.4], [11.4, 11.4]];

const clamped = (value) => Math.min(0.97, Math.max(0.03, value));

/** A panel that is there while a contact is a pointer. */
export class PointerPanel {
  constructor({ bounds_m: [[leftM, bottomM], [rightM, topM]] }) {
    this.widthM = rightM - leftM;
    this.middleM = [(leftM + rightM) / 2, (bottomM + topM) / 2];
    this.card = document.getElementById("pointer-card");
    this.said = document.getElementById("pointer-said");
    this.canvas = document.getElementById("pointer");
    this.at = [0.5, 0.5];
    this.begun = false;
    this.last = null;
    this.drawn = null;
    this.trail = [];
    this.clicks = [];
    this.colours = palette();
  }

  /** Shows an update. */
  show({ pointer, contacts }, now) {
    if (this.card.hidden !== !pointer) {
      this.card.hidden = !pointer;
      if (pointer) this.layOut();
    }
    if (!pointer) return;
    if (!this.begun && contacts.length) this.#begin(contacts[0]);
    this.#go(pointer, now);
    this.drawn = [pointer, now];
    this.#draw(pointer, now);
    const clicks = `${count(pointer.clicks)} ${pointer.clicks === 1 ? "click" : "clicks"}`;
    this.said.textContent = pointer.pressed ? `${clicks}, pressed` : clicks;
    Object.assign(this.card.dataset, { clicks: String(pointer.clicks), at: JSON.stringify(this.at) });
  }

  recolour() {
    this.colours = palette();
  }

  layOut() {
    if (this.card.hidden) return;
    this.width = this.card.clientWidth - 28;
    this.height = Math.round(this.width * SCREEN);
    this.context = sizeCanvas(this.canvas, this.width, this.height);
    // A canvas of a new size is empty, and a paused page gets no update.
    if (this.drawn) this.#draw(...this.drawn);
  }

  // Begins where the first contact is, or the cursor would soon be held at an edge that the contact is not near.
  #begin({ xM, yM }) {
    this.begun = true;
    const [right, up] = [xM - this.middleM[0], yM - this.middleM[1]].map((way) => way / this.widthM);
    this.at = [clamped(0.5 + right), clamped(0.5 - up / SCREEN)];
  }

  // The width of the detector is that of the screen.
  #go({ wayM, clicks }, now) {
    const last = this.last ?? { wayM, clicks };
    const [dx, dy] = [0, 1].map((axis) => (wayM[axis] - last.wayM[axis]) / this.widthM);
    this.at = [clamped(this.at[0] + dx), clamped(this.at[1] - dy / SCREEN)];
    this.trail.push({ at: now, place: this.at });
    if (clicks > last.clicks) this.clicks.push({ at: now, place: this.at });
    this.trail = this.trail.filter(({ at }) => now - at < TRAIL_MS);
    this.clicks = this.clicks.filter(({ at }) => now - at < CLICK_MS);
    this.last = { wayM, clicks };
  }

  #draw({ pressed }, now) {
    const { context, width, height, colours } = this;
    /** @param {number[]} place */
    const onScreen = ([x, y]) => [x * width, y * height];
    context.fillStyle = faded(colours.muted, 0.1);
    context.clearRect(0, 0, width, height);
    context.fillRect(0, 0, width, height);
    context.lineWidth = 2;
    for (let i = 1; i < this.trail.length; i += 1) {
      context.strokeStyle = faded(colours.accent, 0.5 * (1 - (now - this.trail[i].at) / TRAIL_MS));
      context.beginPath();
      context.moveTo(...onScreen(this.trail[i - 1].place));
      context.lineTo(...onScreen(this.trail[i].place));
      context.stroke();
    }
    for (const { at, place } of this.clicks) {
      const age = (now - at) / CLICK_MS;
      context.strokeStyle = faded(colours.bad, 0.9 * (1 - age));
      context.beginPath();
      context.arc(...onScreen(place), 5 + 22 * Math.sqrt(age), 0, 2 * Math.PI);
      context.stroke();
    }
    this.#drawArrow(onScreen(this.at), pressed);
  }

  /** @param {number[]} place */
  #drawArrow([x, y], pressed) {
    const { context, colours } = this;
    context.beginPath();
    ARROW.forEach(([dx, dy], i) => (i ? context.lineTo(x + dx, y + dy) : context.moveTo(x, y)));
    context.closePath();
    context.fillStyle = pressed ? colours.bad : colours.ink;
    context.fill();
    context.lineWidth = 1.2;
    context.strokeStyle = colours.card;
    context.stroke();
  }
}
