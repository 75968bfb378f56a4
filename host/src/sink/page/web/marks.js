// What is drawn over the heat for each contact: its way, its uncertainty, its size where that is known, and its label.

import { faded } from "./palette.js";

// The ellipse holds the true place in 86 of 100 frames: two standard errors. Smaller ones (pixels) would hide in the centre's
// dot, larger ones say nothing.
const DEVIATIONS = 2;
const SMALLEST_ELLIPSE = 4;
const LARGEST_ELLIPSE = 2000;
const TRAIL_WIDTH = 5;
const PILL = { height: 22, badge: 9, font: "600 12.5px system-ui, sans-serif" };

/** The half axes (m) of one standard error and the direction of the longer (radians, anticlockwise), or null. */
export function ellipseOf({ xErrorM, yErrorM, correlation }) {
  if (xErrorM === null || yErrorM === null) return null;
  const [xx, yy, xy] = [xErrorM ** 2, yErrorM ** 2, (correlation ?? 0) * xErrorM * yErrorM];
  const [mean, half] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  return {
    longM: Math.sqrt(mean + half), shortM: Math.sqrt(Math.max(0, mean - half)), radians: Math.atan2(2 * xy, xx - yy) / 2,
  };
}

function drawEllipse(context, contact, [x, y], perM, colour) {
  const of = ellipseOf(contact);
  const long = of ? DEVIATIONS * of.longM * perM : 0;
  if (long < SMALLEST_ELLIPSE || long > LARGEST_ELLIPSE) return;
  context.beginPath();
  context.ellipse(x, y, long, Math.max(1, DEVIATIONS * of.shortM * perM), -of.radians, 0, 2 * Math.PI);
  context.fillStyle = faded(colour, 0.14);
  context.fill();
  context.setLineDash([5, 3]);
  context.lineWidth = 1.5;
  context.strokeStyle = colour;
  context.stroke();
  context.setLineDash([]);
}

/** A contact's size, where it is known, its uncertainty and its centre, at `[x, y]` pixels. */
export function drawMark(context, contact, [x, y], perM, colours) {
  const colour = colours.hue(contact.id);
  if (contact.radiusM !== null) {
    context.beginPath();
    context.arc(x, y, contact.radiusM * perM, 0, 2 * Math.PI);
    context.lineWidth = 1.5;
    context.strokeStyle = faded(colours.ink, 0.5);
    context.stroke();
  }
  drawEllipse(context, contact, [x, y], perM, colour);
  drawDot(context, contact, [x, y], colours);
}

/** A contact's centre at `[x, y]` pixels. */
export function drawDot(context, { id }, [x, y], colours) {
  context.beginPath();
  context.arc(x, y, 3, 0, 2 * Math.PI);
  context.fillStyle = colours.hue(id);
  context.fill();
  context.lineWidth = 1.5;
  context.strokeStyle = colours.card;
  context.stroke();
}

/** The way of a contact, fading: points `{x, y, age}` in pixels. */
export function drawTrail(context, id, points, colours) {
  context.lineCap = "round";
  for (let i = 1; i < points.length; i += 1) {
    const left = 1 - points[i].age;
    if (points[i].begins) continue;
    context.strokeStyle = faded(colours.hue(id), 0.6 * left);
    context.lineWidth = Math.max(0.5, TRAIL_WIDTH * left);
    context.beginPath();
    context.moveTo(points[i - 1].x, points[i - 1].y);
    context.lineTo(points[i].x, points[i].y);
    context.stroke();
  }
}

// How much of each other two boxes cover (pixels).
function covered(a, b) {
  const across = Math.min(a.x + a.width, b.x + b.width) - Math.max(a.x, b.x);
  const down = Math.min(a.y + a.height, b.y + b.height) - Math.max(a.y, b.y);
  return across > 0 && down > 0 ? across * down : 0;
}

// The place about the contact, right of it if that is free, where its label covers least.
function placeFor(width, { x, y, radius }, taken, box) {
  const { height } = PILL;
  const gap = radius + 7;
  const [right, left, above, below] = [x + gap, x - gap - width, y - gap - height, y + gap];
  const places = [[right, y - height / 2], [left, y - height / 2], [x - width / 2, above], [x - width / 2, below],
    [right - 5, above + 5], [left + 5, above + 5], [right - 5, below - 5], [left + 5, below - 5]];
  const costOf = (pill) => taken.reduce((sum, other) => sum + covered(pill, other), 0)
    + 4 * (width * height - covered(pill, { x: 0, y: 0, ...box }));
  let best = null;
  for (const [px, py] of places) {
    const pill = { x: px, y: py, width, height };
    const cost = costOf(pill);
    if (!best || cost < best.cost) best = { ...pill, cost };
    if (cost === 0) break;
  }
  return best;
}

// Widths of texts in the font of labels (pixels): each is drawn many times.
const MOST_WIDTHS = 1000;
const widths = new Map();

function widthOf(context, text) {
  const known = widths.get(text);
  if (known !== undefined) return known;
  if (widths.size >= MOST_WIDTHS) widths.clear();
  const { width } = context.measureText(text);
  widths.set(text, width);
  return width;
}

/** Labels of contacts: `spots` with the contact, the `text` of its label, its pixels `x`, `y` and its `radius` there; `box` that they stay in; `others` are circles `{x, y, radius}` that they leave free. */
export function drawLabels(context, spots, colours, box, others = []) {
  context.font = PILL.font;
  context.textBaseline = "middle";
  const taken = [...spots, ...others].map(({ x, y, radius }) => ({ x: x - radius, y: y - radius, width: 2 * radius, height: 2 * radius }));
  for (const spot of spots) {
    const { contact, text } = spot;
    const badge = contact.id ? Math.max(2 * PILL.badge, widthOf(context, String(contact.id)) + 9) : 0;
    const pill = placeFor(badge + widthOf(context, text) + 16, spot, taken, box);
    taken.push(pill);
    drawPill(context, pill, contact, text, badge, colours);
  }
}

function drawPill(context, pill, { id }, text, badge, colours) {
  const middle = pill.y + pill.height / 2;
  context.beginPath();
  context.roundRect(pill.x, pill.y, pill.width, pill.height, pill.height / 2);
  context.fillStyle = faded(colours.card, 0.88);
  context.fill();
  context.lineWidth = 1;
  context.strokeStyle = colours.edge;
  context.stroke();
  if (id) {
    context.beginPath();
    context.roundRect(pill.x + 2, middle - PILL.badge, badge, 2 * PILL.badge, PILL.badge);
    context.fillStyle = colours.hue(id);
    context.fill();
    context.fillStyle = colours.card;
    context.textAlign = "center";
    context.fillText(String(id), pill.x + 2 + badge / 2, middle + 0.5);
  }
  context.textAlign = "left";
  context.fillStyle = colours.ink;
  context.fillText(text, pill.x + badge + 8, middle + 0.5);
}
