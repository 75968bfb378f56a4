// Pressing on the simulated detector, with the mouse, a finger or the keyboard.

const STEP_M = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
// The cursor moves by this share of the detector's longer side.
const STEP_SHARE = 1 / 40;

/** Turns presses on `picture` into requests through `send`. */
export function listenForPresses(picture, send) {
  const { box } = picture;
  let pressing = false;
  let wanted = null;
  let cursor = null;

  // At most one request for each frame that the browser draws.
  const press = (place) => {
    if (!wanted) requestAnimationFrame(() => {
      if (pressing) send({ press: { x_m: wanted[0], y_m: wanted[1] } });
      wanted = null;
    });
    wanted = place;
    pressing = true;
  };
  const release = () => {
    if (!pressing) return;
    pressing = false;
    send("release");
    if (cursor) picture.showCursor(cursor, false);
  };

  box.onpointerdown = (event) => {
    const place = picture.placeOf(event);
    if (!place || event.button !== 0) return;
    event.preventDefault();
    box.focus({ preventScroll: true, focusVisible: false });
    box.setPointerCapture(event.pointerId);
    picture.showCursor(cursor = null);
    press(place);
  };
  box.onpointermove = (event) => {
    const place = pressing && !cursor && picture.placeOf(event);
    if (place) press(place);
  };
  box.onpointerup = release;
  box.onpointercancel = release;
  box.onlostpointercapture = release;

  const moveCursor = ([dx, dy]) => {
    const [low, high] = picture.scene.bounds_m;
    const step = STEP_SHARE * Math.max(...picture.sizeM);
    const from = cursor ?? [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    cursor = [from[0] + step * dx, from[1] + step * dy].map((v, k) => Math.min(high[k], Math.max(low[k], v)));
    if (pressing) press(cursor);
    picture.showCursor(cursor, pressing);
  };
  box.onkeydown = (event) => {
    const step = STEP_M[event.key];
    if (!step && event.key !== " ") return;
    event.preventDefault();
    if (step) moveCursor(step);
    else if (!event.repeat) {
      if (!cursor) moveCursor([0, 0]);
      press(cursor);
      picture.showCursor(cursor, true);
    }
  };
  box.onkeyup = (event) => { if (event.key === " ") release(); };
  box.onblur = () => {
    release();
    picture.showCursor(cursor = null);
  };
}
