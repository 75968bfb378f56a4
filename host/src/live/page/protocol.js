// What passes the socket. The program's side is `live/server/wire.rs`; the layout is described there and must be the same.

/** Version of the layout below; the scene carries the program's. */
export const LAYOUT = 1;

const HEADER_BYTES = 24;

/**
 * An update: six little-endian u32 (layout, sequence number of the frame, frames received so far, nodes, electrodes, contacts
 * found), then as little-endian f32 the image (S/m2, one a node), the readings (V, row g, column e), and the contacts found
 * (x in m, y in m, conductance in S, each).
 */
export function decodeUpdate(buffer) {
  const view = new DataView(buffer);
  const [layout, sequence, frames, nodes, electrodes, contacts] =
    Array.from({ length: 6 }, (_, i) => view.getUint32(4 * i, true));
  if (layout !== LAYOUT) throw new Error("The program is of another version than this page: reload it.");
  let offset = HEADER_BYTES;
  const take = (length) => {
    const part = new Float32Array(buffer, offset, length);
    offset += 4 * length;
    return part;
  };
  return {
    sequence, frames, electrodes,
    image: take(nodes),
    readings: take(electrodes * electrodes),
    contacts: Array.from({ length: contacts }, () => {
      const [xM, yM, conductanceS] = take(3);
      return { xM, yM, conductanceS };
    }),
  };
}

const RETRY_MS = [250, 500, 1000, 2000];

/**
 * The socket to the program: connects, and connects again when it is lost. `on` has `scene`, `status`, `update`, each given a
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
    this.socket = new WebSocket(`ws://${location.host}/socket`);
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
    if (message.type === "scene") this.on.scene(message);
    if (message.type === "status") this.on.status(message);
    this.taken();
  }
}
