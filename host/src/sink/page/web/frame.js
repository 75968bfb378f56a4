// What stays on the picture: outline, electrodes, axes and the colour bar.

import { colourMaps, css } from "./colours.js";
import { sizeCanvas } from "./layout.js";
import { faded } from "./palette.js";
import { decimalsOf, fixed, niceStep, ticks } from "./units.js";

const FONT = "11.5px system-ui, sans-serif";
const BAR = { gap: 18, narrowGap: 8, width: 12 };
// Tick marks of the colour bar, as shares of its height: even where values are not.
const BAR_MARKS = 5;

function text(context, x, y, words, align = "center", baseline = "middle") {
  context.textAlign = align;
  context.textBaseline = baseline;
  context.fillText(words, x, y);
}

function upright(context, x, y, words, direction) {
  context.save();
  context.translate(x, y);
  context.rotate(direction * Math.PI / 2);
  text(context, 0, 0, words);
  context.restore();
}

/** A canvas over the heat and under the marks, drawn anew only when what is on it has changed: frames are many, and it hardly ever changes. */
export class FrameCanvas {
  context; width; height; drawn;

  constructor() { this.canvas = document.getElementById("frame"); }

  /** Makes it so many pixels large. */
  layOut(width, height) {
    Object.assign(this, { width, height, drawn: null });
    this.context = sizeCanvas(this.canvas, width, height);
  }

  /** Calls `paint(context)` unless what `of` says of it is as it was. */
  draw(of, paint) {
    const key = JSON.stringify(of);
    if (key === this.drawn) return;
    this.drawn = key;
    this.context.clearRect(0, 0, this.width, this.height);
    paint(this.context);
  }
}

// The outline as a path in pixels.
function outlinePath(loops, x, y) {
  const path = new Path2D();
  for (const loop of loops) {
    loop.forEach(([xM, yM], i) => (i ? path.lineTo(x(xM), y(yM)) : path.moveTo(x(xM), y(yM))));
    path.closePath();
  }
  return path;
}

function drawAxes(context, layout, colours) {
  const { leftM, rightM, bottomM, topM } = layout;
  const most = Math.max(3, Math.min(10, Math.max(layout.width, layout.height) / 60));
  const step = niceStep(Math.max(rightM - leftM, topM - bottomM), most);
  const decimals = decimalsOf(step * 1e3);
  const low = layout.top + layout.height;
  context.fillStyle = context.strokeStyle = colours.muted;
  for (const xM of ticks(leftM, rightM, step)) text(context, layout.x(xM), low + 14, fixed(xM * 1e3, decimals));
  for (const yM of ticks(bottomM, topM, step)) text(context, layout.left - 8, layout.y(yM), fixed(yM * 1e3, decimals), "right");
  if (layout.narrow) return;
  text(context, layout.left + layout.width / 2, low + 29, "x (mm)");
  upright(context, layout.left - 42, layout.top + layout.height / 2, "y (mm)", -1);
}

function drawPads(context, electrodes, { x, y, perM, marked, excluded }, colours) {
  electrodes.forEach((pad, i) => {
    const [px, py, r] = [x(pad), y(pad), Math.max(3, pad.radius_m * perM)];
    const bad = excluded.includes(i);
    const role = marked?.g === i ? colours.bad : marked?.e === i ? colours.good : null;
    context.beginPath();
    context.arc(px, py, r, 0, 2 * Math.PI);
    context.lineWidth = role ? 3.5 : bad ? 2 : 1;
    context.strokeStyle = role ?? (bad ? colours.bad : faded(colours.ink, 0.32));
    context.stroke();
    context.fillStyle = bad ? colours.bad : faded(colours.ink, 0.55);
    const beside = r < 8;
    if (!bad) text(context, beside ? px + r + 3 : px, py + 0.5, String(i), beside ? "left" : "center");
    if (bad) drawCross(context, px, py, Math.max(r, 6), colours.bad);
  });
}

function drawCross(context, x, y, size, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 2.5;
  context.beginPath();
  context.moveTo(x - size, y - size);
  context.lineTo(x + size, y + size);
  context.moveTo(x - size, y + size);
  context.lineTo(x + size, y - size);
  context.stroke();
}

/** The colour bar; `share` of its height shows a value of `share` squared of the scale's end. */
export function drawBar(context, { left, width, top, height, narrow }, { scale, theme, colours }) {
  context.font = FONT;
  const x = left + width + (narrow ? BAR.narrowGap : BAR.gap);
  const shades = colourMaps(theme).image;
  const gradient = context.createLinearGradient(0, top + height, 0, top);
  for (let i = 0; i < shades.length; i += 5) gradient.addColorStop(i / (shades.length - 1), css(shades[i]));
  context.beginPath();
  context.roundRect(x, top, BAR.width, height, 3);
  context.fillStyle = gradient;
  context.fill();
  context.lineWidth = 1;
  context.strokeStyle = colours.edge;
  context.stroke();
  const { factor, symbol } = scale.prefixNow;
  context.fillStyle = colours.muted;
  for (let i = 0; i <= BAR_MARKS; i += 1) {
    const value = scale.max * (i / BAR_MARKS) ** 2;
    const digits = i ? Math.max(0, 1 - Math.floor(Math.log10(value / factor) + 1e-9)) : 0;
    text(context, x + BAR.width + 6, top + height * (1 - i / BAR_MARKS), fixed(value / factor, Math.min(3, digits)), "left");
  }
  const unit = `${symbol}S/m²`;
  if (narrow) text(context, x + BAR.width / 2, top + height + 14, unit);
  else upright(context, x + BAR.width + 52, top + height / 2, `pressure, as contact conductance (${unit})`, 1);
}

/** Draws the frame of the flat picture. */
export function drawFrame(context, setup, layout, view) {
  const { colours, marked, excluded } = view;
  const [x, y] = [(xM) => layout.x(xM), (yM) => layout.y(yM)];
  context.font = FONT;
  context.lineWidth = 1;
  context.strokeStyle = faded(colours.muted, 0.7);
  context.stroke(outlinePath(setup.outline_m, x, y));
  const places = { x: (pad) => x(pad.x_m), y: (pad) => y(pad.y_m), perM: layout.perM, marked, excluded };
  drawPads(context, setup.electrodes, places, colours);
  drawAxes(context, layout, colours);
  drawBar(context, layout, view);
}
