// Pressing on the simulated detector: with the mouse, with several fingers, or with the keyboard. A click with Shift leaves a
// finger down; the next click on it lifts it.

const STEP_M = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
// The cursor moves by this share of the detector's longer side; a click this near lifts a finger that was left down.
const STEP_SHARE = 1 / 40;
const LIFT_SHARE = 1 / 12;
const MOST_FINGERS = 10;

const rounded = (metres) => Number(metres.toFixed(6));

/** The fingers of this page. */
class Fingers {
  constructor(picture, send) {
    this.picture = picture;
    this.send = send;
    this.held = new Map();
    this.left = [];
    this.cursor = null;
  }

  /** Puts a finger down at a place (m) or moves it; `key` names it. */
  put(key, place) {
    if (!this.held.has(key) && this.held.size + this.left.length >= MOST_FINGERS) return;
    this.held.set(key, place);
    this.#changed();
  }

  lift(key) {
    if (this.held.delete(key)) this.#changed();
  }

  /** Leaves a finger down, or lifts the one that was left near. */
  leave(place, nearM) {
    const near = this.left.findIndex(([x, y]) => Math.hypot(x - place[0], y - place[1]) < nearM);
    if (near >= 0) this.left.splice(near, 1);
    else if (this.held.size + this.left.length < MOST_FINGERS) this.left.push(place);
    this.#changed();
    return near < 0;
  }

  clear() {
    const any = this.held.size + this.left.length > 0;
    this.held.clear();
    this.left = [];
    if (any) this.#changed();
  }

  /** Shows the cursor of the keyboard at a place (m), or not. */
  point(place) {
    this.cursor = place;
    this.#show();
  }

  // At most one request for each frame that the browser draws.
  #changed() {
    if (!this.due) {
      this.due = true;
      requestAnimationFrame(() => {
        this.due = false;
        const places = [...this.held.values(), ...this.left];
        this.send({ press: places.map(([x, y]) => ({ x_m: rounded(x), y_m: rounded(y) })) });
      });
    }
    this.#show();
  }

  #show() {
    const down = [...this.left, ...(this.cursor && this.held.has("keyboard") ? [this.cursor] : [])];
    const shown = down.map((place) => ({ place, down: true }));
    if (this.cursor && !this.held.has("keyboard")) shown.push({ place: this.cursor, down: false });
    this.picture.showFingers(shown);
  }
}

/** Turns presses on `picture` into requests through `send`; `fingers.clear()` lifts all. */
export function listenForPresses(picture, send) {
  const { box, setup: { bounds_m: [low, high] } } = picture;
  const sizeM = Math.max(high[0] - low[0], high[1] - low[1]);
  const fingers = new Fingers(picture, send);
  listenToPointers(box, picture, fingers, LIFT_SHARE * sizeM);
  listenToKeys(box, fingers, [low, high], STEP_SHARE * sizeM);
  return fingers;
}

function listenToPointers(box, picture, fingers, nearM) {
  box.addEventListener("pointerdown", (event) => {
    const place = picture.placeOf(event);
    if (!place || event.button !== 0) return;
    event.preventDefault();
    box.focus({ preventScroll: true, focusVisible: false });
    fingers.point(null);
    if (event.shiftKey || isNearLeft(fingers, place, nearM)) {
      fingers.leave(place, nearM);
      return;
    }
    box.setPointerCapture(event.pointerId);
    fingers.put(event.pointerId, place);
  });
  box.addEventListener("pointermove", (event) => {
    const place = fingers.held.has(event.pointerId) && picture.placeOf(event);
    if (place) fingers.put(event.pointerId, place);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    box.addEventListener(end, (event) => fingers.lift(event.pointerId));
  }
}

const isNearLeft = ({ left }, place, nearM) => left.some(([x, y]) => Math.hypot(x - place[0], y - place[1]) < nearM);

function listenToKeys(box, fingers, [low, high], stepM) {
  const move = ([dx, dy]) => {
    const from = fingers.cursor ?? low.map((v, k) => (v + high[k]) / 2);
    const place = [from[0] + stepM * dx, from[1] + stepM * dy].map((v, k) => Math.min(high[k], Math.max(low[k], v)));
    fingers.point(place);
    if (fingers.held.has("keyboard")) fingers.put("keyboard", place);
  };
  box.addEventListener("keydown", (event) => {
    const step = STEP_M[event.key];
    if (!step && event.key !== " ") return;
    event.preventDefault();
    if (step) move(step);
    else if (!event.repeat) {
      if (!fingers.cursor) move([0, 0]);
      fingers.put("keyboard", fingers.cursor);
    }
  });
  box.addEventListener("keyup", (event) => { if (event.key === " ") fingers.lift("keyboard"); });
  box.addEventListener("blur", () => {
    fingers.lift("keyboard");
    fingers.point(null);
  });
}
