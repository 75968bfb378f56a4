// What passes the socket. The program's side is `wire.rs`, `messages.rs` and `update.rs`; the layout is described there and must be
// the same.

/** Version of the layout below; the setup carries the program's. */
export const LAYOUT = 9;

const HEAD_WORDS = 11;
// From the lowest bit on.
const FLAGS = ["saturated", "misfit", "unfinished", "calibrate"];

const known = (value) => (Number.isNaN(value) ? null : value);
const bitsOf = (word) => Array.from({ length: 32 }, (_, bit) => bit).filter((bit) => (word >>> bit) & 1);

// Takes little-endian numbers from a buffer, one after the other.
class Taker {
  constructor(buffer) {
    this.buffer = buffer;
    this.view = new DataView(buffer);
    this.offset = 0;
  }

  word() {
    this.offset += 4;
    return this.view.getUint32(this.offset - 4, true);
  }

  floats(length) {
    this.offset += 4 * length;
    return new Float32Array(this.buffer, this.offset - 4 * length, length);
  }

  text() {
    return new TextDecoder().decode(new Uint8Array(this.buffer, this.offset));
  }
}

function contact(taker) {
  const id = taker.word() || null;
  const [x, y, z, ...others] = taker.floats(16);
  const [conductanceS, apparentS, radiusM, forceN, forceErrorN, beyond, xErrorM, yErrorM, correlation, errorS, depthM] = others.slice(0, 11).map(known);
  const [xM, yM] = others.slice(11);
  return {
    id, xM, yM, conductanceS, apparentS, radiusM, forceN, forceErrorN, beyondMaximum: beyond === 1, xErrorM, yErrorM, correlation, errorS,
    depthM, place: [x, y, z],
  };
}

/**
 * What the pointer has done, if a contact is one.
 * @param {Float32Array} numbers
 */
function pointer([xM, yM, pressed, clicks]) {
  return Number.isNaN(clicks) ? null : { wayM: [xM, yM], pressed: pressed === 1, clicks };
}

const SHAPES = [null, "line", "ring"];

// What touches as one: a line or a ring.
function shape(taker, kind) {
  const [fromX, fromY, toX, toY, x, y, ...others] = [...taker.floats(18)].map(known);
  const [radiusM, widthM, conductanceS] = others;
  const errorsM = others.slice(3, 10);
  return kind === "line"
    ? { kind, from: [fromX, fromY], to: [toX, toY], widthM, conductanceS, errorsM: errorsM.slice(0, 4), errorS: others[11] }
    : { kind, centre: [x, y], radiusM, widthM, conductanceS, errorsM: errorsM.slice(4), errorS: others[11] };
}

function choice(text) {
  const [what, why] = text.split("\n");
  return why === undefined ? null : { what, why };
}

/**
 * An update: the newest frame and what the solver says of it. What is not known is null. Contacts beside a shape are not what touches, and
 * are kept apart from the others.
 */
export function decodeUpdate(buffer) {
  const taker = new Taker(buffer);
  const [layout, sequence, frames, nodes, electrodes, count, kind, flags, excluded, exchanged, points] =
    Array.from({ length: HEAD_WORDS }, () => taker.word());
  if (layout !== LAYOUT) throw new Error("The program is of another version than this page: reload it.");
  const [residual, ageS] = [...taker.floats(2)].map(known);
  const pointed = pointer(taker.floats(4));
  const [image, readings, course] = [taker.floats(nodes), taker.floats(electrodes * electrodes), taker.floats(points)];
  const contacts = Array.from({ length: count }, () => contact(taker));
  return {
    sequence, frames, residual, ageS, electrodes, flags: bitsOf(flags).map((bit) => FLAGS[bit]), excluded: bitsOf(excluded), exchanged: bitsOf(exchanged),
    image, readings, course,
    pointer: pointed,
    contacts: kind ? [] : contacts,
    beside: kind ? contacts : [],
    shape: kind ? shape(taker, SHAPES[kind]) : null,
    choice: choice(taker.text()),
  };
}

const RETRY_MS = [250, 500, 1000, 2000];

/**
 * The socket to the program: connects, and connects again when it is lost. `on` has `setup`, `status`, `update`, each given a
 * message, and `lost`. After each message the program waits for `taken()`.
 */
export class Connection {
  constructor(on) {
    this.on = on;
    this.attempt = 0;
    this.#connect();
  }

  /** Tells the program that this page has dealt with the last message and wants the next. */
  taken() {
    this.send("taken");
  }

  /** Sends a request; does nothing while the program is lost. */
  send(request) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  #connect() {
    // Beside the page, behind the token if there is one.
    const address = new URL("socket", location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.attempt = 0; };
    this.socket.onmessage = ({ data }) => this.#receive(data);
    this.socket.onclose = ({ reason }) => {
      this.on.lost(reason);
      const wait = RETRY_MS[Math.min(this.attempt, RETRY_MS.length - 1)];
      this.attempt += 1;
      setTimeout(() => this.#connect(), wait);
    };
  }

  #receive(data) {
    if (data instanceof ArrayBuffer) {
      this.on.update(decodeUpdate(data));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "setup") this.on.setup(message);
    if (message.type === "status") this.on.status(message);
    this.taken();
  }
}
