// Where the flat picture lies on the screen.

const WIDE = { left: 50, right: 92, top: 10, bottom: 36 };
const NARROW = { left: 29, right: 50, top: 6, bottom: 24 };
const NARROW_BELOW = 520;

/** Fits bounds (m) into a box of pixels; `x`, `y` turn places (m) into pixels, `placeOf` pixels into places. */
export class Layout {
  leftM; bottomM; rightM; topM; boxWidth; boxHeight;

  constructor([[leftM, bottomM], [rightM, topM]], boxWidth, boxHeight) {
    this.narrow = boxWidth < NARROW_BELOW;
    const margin = this.narrow ? NARROW : WIDE;
    const [width, height] = [boxWidth - margin.left - margin.right, boxHeight - margin.top - margin.bottom];
    Object.assign(this, { leftM, bottomM, rightM, topM, boxWidth, boxHeight });
    this.perM = Math.max(1, Math.min(width / (rightM - leftM), height / (topM - bottomM)));
    this.width = this.perM * (rightM - leftM);
    this.height = this.perM * (topM - bottomM);
    this.left = margin.left + Math.max(0, (width - this.width) / 2);
    this.top = margin.top + Math.max(0, (height - this.height) / 2);
  }

  x(xM) { return this.left + (xM - this.leftM) * this.perM; }

  y(yM) { return this.top + (this.topM - yM) * this.perM; }

  /** The place (m) at a pixel of the box, or null off the bounds. */
  placeOf(x, y) {
    const [right, down] = [(x - this.left) / this.perM, (y - this.top) / this.perM];
    if (right < 0 || down < 0 || right > this.rightM - this.leftM || down > this.topM - this.bottomM) return null;
    return [this.leftM + right, this.topM - down];
  }
}

/** Makes a canvas as sharp as the screen, `width` x `height` CSS pixels large; its context in those pixels. */
export function sizeCanvas(canvas, width, height, mostRatio = 2) {
  const ratio = Math.min(mostRatio, window.devicePixelRatio || 1);
  [canvas.width, canvas.height] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
  const context = canvas.getContext("2d");
  context.setTransform(canvas.width / width, 0, 0, canvas.height / height, 0, 0);
  return context;
}
