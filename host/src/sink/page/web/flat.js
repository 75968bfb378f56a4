// The flat picture: the detector from above, heat on one canvas, everything else on another over it.

import { drawOutline, middleOf } from "./bars.js";
import { colourMaps } from "./colours.js";
import { drawFrame, FrameCanvas } from "./frame.js";
import { Layout, sizeCanvas } from "./layout.js";
import { drawLabels, drawMark, drawTrail } from "./marks.js";
import { TARGET_RADIUS, drawTarget } from "./target.js";

/** The heat of a field on a canvas, one pixel of the one to one of the other: the browser makes it as large as the picture, smoothly, and with the graphics processor where there is one. */
export class HeatCanvas {
  constructor(canvas, field) {
    [canvas.width, canvas.height] = [field.width, field.height];
    this.field = field;
    this.context = canvas.getContext("2d");
    this.image = new ImageData(field.width, field.height);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  /** Draws it up to `max` (S/m2) in the colours of a theme. */
  draw(max, theme) {
    const colours = colourMaps(theme).image;
    const [last, factor] = [colours.length - 1, 1 / max];
    for (let i = 0; i < this.pixels.length; i += 1) {
      if (!this.field.isOn(i)) continue; // stays transparent
      const share = this.field.values[i] * factor;
      this.pixels[i] = colours[share <= 0 ? 0 : share >= 1 ? last : Math.round(last * Math.sqrt(share))];
    }
    this.context.putImageData(this.image, 0, 0);
  }
}

/** Draws the heat of `view.field` on the scale `view.scale` in the colours of `view.theme`. */
export class FlatView {
  constructor(view) {
    this.view = view;
    this.canvas = document.getElementById("image");
    this.frame = new FrameCanvas();
    this.marks = document.getElementById("marks");
    this.heat = new HeatCanvas(this.canvas, view.field);
  }

  /** Fits into a box of pixels. */
  layOut(width, height) {
    const { setup } = this.view;
    this.layout = new Layout(setup.bounds_m, width, height);
    const { left, top } = this.layout;
    const { style } = this.canvas;
    [style.left, style.top] = [`${left}px`, `${top}px`];
    [style.width, style.height] = [`${this.layout.width}px`, `${this.layout.height}px`];
    this.frame.layOut(width, height);
    this.over = sizeCanvas(this.marks, width, height);
  }

  /** Draws all of it. */
  draw(now) {
    const { view, over, layout } = this;
    this.heat.draw(view.scale.max, view.theme);
    const { theme, scale, marked, excluded } = view;
    this.frame.draw([theme, scale.max, marked, excluded], (context) => drawFrame(context, view.setup, layout, view));
    over.clearRect(0, 0, layout.boxWidth, layout.boxHeight);
    for (const [id, way] of view.trails.all(now)) {
      const points = way.map(({ xM, yM, ...rest }) => ({ ...rest, x: layout.x(xM), y: layout.y(yM) }));
      drawTrail(over, id, points, view.colours);
    }
    const spots = view.field.contacts.map((contact) => ({
      contact, text: view.labelOf(contact), x: layout.x(contact.xM), y: layout.y(contact.yM), radius: view.field.radiusOf(contact) * layout.perM,
    }));
    const { shape } = view.field;
    if (shape) {
      drawOutline(over, shape, { x: (xM) => layout.x(xM), y: (yM) => layout.y(yM), perM: layout.perM }, view.colours);
      const [xM, yM] = middleOf(shape);
      spots.push({ contact: shape, text: view.labelOf(shape), x: layout.x(xM), y: layout.y(yM), radius: (shape.widthM * layout.perM) / 2 });
    }
    for (const { contact, x, y } of spots.filter((spot) => !spot.contact.kind)) drawMark(over, contact, [x, y], layout.perM, view.colours);
    const target = view.target && { x: layout.x(view.target.at_m[0]), y: layout.y(view.target.at_m[1]), radius: TARGET_RADIUS };
    drawLabels(over, spots, view.colours, { width: layout.left + layout.width + 4, height: layout.boxHeight }, target ? [target] : []);
    if (target) drawTarget(over, view.target, [target.x, target.y], view.colours);
    this.#drawFingers();
  }

  // Where the person presses, and the cursor of the keyboard.
  #drawFingers() {
    const { over, layout, view } = this;
    over.strokeStyle = view.colours.ink;
    over.lineWidth = 1.5;
    for (const { place, down } of view.fingers) {
      over.setLineDash(down ? [] : [3, 3]);
      over.beginPath();
      over.arc(layout.x(place[0]), layout.y(place[1]), 14, 0, 2 * Math.PI);
      over.stroke();
    }
    over.setLineDash([]);
  }
}
