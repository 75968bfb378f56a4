// Where to press next while it is calibrated.

const RING = { radius: 17, firmWidth: 6, lightWidth: 2.5 };

/** Radius of all of it (pixels). */
export const TARGET_RADIUS = RING.radius + RING.firmWidth / 2 + 2;

/** Draws a target at `[x, y]` pixels: a thick ring to press firmly, a thin one to press lightly. */
export function drawTarget(context, { firm }, [x, y], colours) {
  for (const [width, colour] of [[(firm ? RING.firmWidth : RING.lightWidth) + 4, colours.card], [firm ? RING.firmWidth : RING.lightWidth, colours.accent]]) {
    context.beginPath();
    context.arc(x, y, RING.radius, 0, 2 * Math.PI);
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.stroke();
  }
  context.beginPath();
  context.arc(x, y, 3, 0, 2 * Math.PI);
  context.fillStyle = colours.accent;
  context.fill();
}
