// A line or a ring that touches: its words, its place in the table and its outline over the heat.

import { faded } from "./palette.js";
import { millimetres } from "./units.js";

/** Length of a line (m). */
const lengthM = ({ from, to }) => Math.hypot(to[0] - from[0], to[1] - from[1]);

/** What a passer-by calls it. */
export function nameOf(shape) {
  return shape.kind === "line" ? `Line, ${millimetres(lengthM(shape), 0)} mm` : `Ring, ${millimetres(2 * shape.radiusM, 0)} mm`;
}

/** Where it is, in millimetres: the ends of a line, the middle of a ring. */
export function placesOf(shape) {
  const at = ([xM, yM]) => `${millimetres(xM, 1)}, ${millimetres(yM, 1)}`;
  return shape.kind === "line" ? [at(shape.from), `to ${at(shape.to)}`] : [at(shape.centre)];
}

/** The middle of it (m). */
export const centreOf = (shape) => (shape.kind === "line" ? [0, 1].map((axis) => (shape.from[axis] + shape.to[axis]) / 2) : shape.centre);

/** The largest standard error of a place (m), or null. */
export const errorOf = ({ errorsM }) => (errorsM.includes(null) ? null : Math.max(...errorsM));

/** A place (m) in the middle of the strip, for its label. */
export const middleOf = (shape) => (shape.kind === "line"
  ? centreOf(shape)
  : [shape.centre[0] + shape.radiusM * Math.SQRT1_2, shape.centre[1] + shape.radiusM * Math.SQRT1_2]);

/** Its outline; `x` and `y` turn places (m) into pixels, of which there are `perM` in a metre. */
export function drawOutline(context, shape, { x, y, perM }, colours) {
  const half = (shape.widthM * perM) / 2;
  context.beginPath();
  if (shape.kind === "line") {
    const [[ax, ay], [bx, by]] = [shape.from, shape.to].map(([xM, yM]) => [x(xM), y(yM)]);
    const length = Math.hypot(bx - ax, by - ay) || 1;
    const [nx, ny] = [(-half * (by - ay)) / length, (half * (bx - ax)) / length];
    context.moveTo(ax + nx, ay + ny);
    context.lineTo(bx + nx, by + ny);
    context.lineTo(bx - nx, by - ny);
    context.lineTo(ax - nx, ay - ny);
    context.closePath();
  } else {
    const [cx, cy] = [x(shape.centre[0]), y(shape.centre[1])];
    for (const radius of [shape.radiusM * perM - half, shape.radiusM * perM + half]) {
      context.moveTo(cx + Math.max(0, radius), cy);
      context.arc(cx, cy, Math.max(0, radius), 0, 2 * Math.PI);
    }
  }
  context.lineWidth = 1.5;
  context.strokeStyle = faded(colours.ink, 0.6);
  context.stroke();
}
