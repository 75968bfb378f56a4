// The eye in space: turned by dragging and by arrow keys, brought nearer with the wheel, two fingers, or plus and minus.

const TURN = 0.008;
const ZOOM = 0.0012;
const [NEAREST, FARTHEST] = [0.4, 3];
// What a key does: turns (rad), tilts (rad), brings nearer (a factor).
const KEYS = {
  ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1], "+": [0, 0, 1.15], "=": [0, 0, 1.15], "-": [0, 0, 1 / 1.15],
};
// Distance of the eye, in sizes of the detector: from nearer, perspective exaggerates.
const DISTANCE = 3.4;
// A unit vector: to the left, up, towards the eye.
const OVER_THE_SHOULDER = [0.5, 0.55, 0.67];

/** Turns places (m) into pixels. */
export class Camera {
  turn; tilt; zoom; lowest; begin;

  /** Looks from where a shape says, and never from below `lowest` (rad). */
  constructor({ turn, tilt = 0.7 }, lowest = -0.2) {
    Object.assign(this, { turn, tilt, lowest, zoom: 1, begin: { turn, tilt, zoom: 1 } });
  }

  /** Looks as at the beginning. */
  reset() { Object.assign(this, this.begin); }

  /** Does what a key asks, if it asks something; returns whether it did. */
  press({ key, ctrlKey, metaKey, altKey }) {
    if (ctrlKey || metaKey || altKey) return false;
    if (key === "0" || key === "Home") this.reset();
    else if (!KEYS[key]) return false;
    else {
      const [turn, tilt, factor] = KEYS[key];
      this.#turnBy(turn / TURN, tilt / TURN);
      this.#zoomBy(factor);
    }
    return true;
  }

  /** Makes `element` turn the camera; calls `changed` when it did. */
  listen(element, isOn, changed) {
    const pointers = new Map();
    const spread = () => {
      const [a, b] = [...pointers.values()];
      return b && Math.hypot(a.x - b.x, a.y - b.y);
    };
    element.addEventListener("pointerdown", (event) => {
      if (!isOn()) return;
      element.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    element.addEventListener("pointermove", (event) => {
      const from = pointers.get(event.pointerId);
      if (!from) return;
      const before = spread();
      const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (before) this.#zoomBy(spread() / before);
      else this.#turnBy(dx, dy);
      changed();
    });
    const end = (event) => pointers.delete(event.pointerId);
    element.addEventListener("pointerup", end);
    element.addEventListener("pointercancel", end);
    element.addEventListener("wheel", (event) => {
      if (!isOn()) return;
      event.preventDefault();
      this.#zoomBy(Math.exp(-ZOOM * event.deltaY));
      changed();
    }, { passive: false });
  }

  /** Turns by so many pixels of dragging. */
  #turnBy(dx, dy) {
    this.turn += TURN * dx;
    this.tilt = Math.min(Math.PI / 2, Math.max(this.lowest, this.tilt + TURN * dy));
  }

  #zoomBy(factor) { this.zoom = Math.min(FARTHEST, Math.max(NEAREST, this.zoom * factor)); }

  /** Where a direction points on the screen: right, down and away. */
  direction(direction) {
    const [dx, dy, dz] = direction;
    const [cosTurn, sinTurn, cosTilt, sinTilt] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    const away = dx * sinTurn + dy * cosTurn;
    return [dx * cosTurn - dy * sinTurn, -away * sinTilt - dz * cosTilt, away * cosTilt - dz * sinTilt];
  }

  /** The direction that light comes from: over the left shoulder of who looks. */
  light() {
    const [cosTurn, sinTurn, cosTilt, sinTilt] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    const [left, up, near] = OVER_THE_SHOULDER;
    const away = up * sinTilt - near * cosTilt;
    return [-left * cosTurn + away * sinTurn, left * sinTurn + away * cosTurn, up * cosTilt + near * sinTilt];
  }

  /** The direction halfway between the light and the eye: what faces it shines. */
  shine() {
    const [cosTilt, sinTilt] = [Math.cos(this.tilt), Math.sin(this.tilt)];
    const eye = [-Math.sin(this.turn) * cosTilt, -Math.cos(this.turn) * cosTilt, sinTilt];
    const sum = this.light().map((v, k) => v + eye[k]);
    const length = Math.hypot(...sum);
    return sum.map((v) => v / length);
  }

  /**
   * Projects `points` (m), x, y, z one after the other, to `x`, `y` on `width` x `height` pixels and the depth `z` (m). However it is turned, all of the
   * shape fits into the picture.
   */
  project({ centre, sizeM, radiusM, halfHeightM }, points, { x, y, z }, width, height) {
    const [cosTurn, sinTurn, cosTilt, sinTilt] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    const eye = DISTANCE * sizeM;
    // What is near is larger: but what is nearest is in the middle, and what is at the sides as far as the centre.
    const across = 2.1 * radiusM;
    const down = 2.1 * (radiusM * Math.abs(sinTilt) + halfHeightM * cosTilt);
    const scale = this.zoom * Math.min(width / across, height / down);
    for (let i = 0, k = 0; k < points.length; i += 1, k += 3) {
      const [dx, dy, dz] = [points[k] - centre[0], points[k + 1] - centre[1], points[k + 2] - centre[2]];
      const away = dx * sinTurn + dy * cosTurn;
      z[i] = away * cosTilt - dz * sinTilt;
      const near = (scale * eye) / (eye + z[i]);
      x[i] = width / 2 + (dx * cosTurn - dy * sinTurn) * near;
      y[i] = height / 2 - (away * sinTilt + dz * cosTilt) * near;
    }
  }

  /** A function that projects one place. */
  projection(shape, width, height) {
    const [x, y, z] = [[0], [0], [0]];
    return (...place) => {
      this.project(shape, place, { x, y, z }, width, height);
      return [x[0], y[0], z[0]];
    };
  }
}
