// What passes the socket. The program's side is `wire.rs`, `messages.rs` and `update.rs`. What is in an update, and in which order, the program says in
// its setup as `layout`: everything is read by name here.

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

  words(names) { return Object.fromEntries(names.map((name) => [name, this.word()])); }

  // What is not known is null.
  numbers(names) {
    const values = this.floats(names.length);
    return Object.fromEntries(names.map((name, i) => [name, Number.isNaN(values[i]) ? null : values[i]]));
  }

  text() {
    return new TextDecoder().decode(new Uint8Array(this.buffer, this.offset));
  }
}

function contact(taker, names) {
  const id = taker.word() || null;
  const values = taker.numbers(names);
  return {
    id,
    xM: values.map_x_m,
    yM: values.map_y_m,
    place: [values.x_m, values.y_m, values.z_m],
    conductanceS: values.conductance_s,
    apparentS: values.apparent_conductance_s,
    radiusM: values.radius_m,
    forceN: values.force_n,
    forceErrorN: values.force_deviation_n,
    beyondMaximum: values.force_beyond_maximum === 1,
    xErrorM: values.sigma_x_m,
    yErrorM: values.sigma_y_m,
    correlation: values.correlation,
    errorS: values.sigma_conductance_s,
    depthM: values.depth_m,
    areaM2: values.area_m2,
  };
}

// What touches as one: a line or a ring.
function shape(taker, names, kind) {
  const values = taker.numbers(names);
  const both = {
    kind, widthM: values.shape_width_m, conductanceS: values.shape_conductance_s, errorS: values.shape_sigma_conductance_s,
  };
  return kind === "line"
    ? {
      ...both,
      from: [values.shape_from_x_m, values.shape_from_y_m],
      to: [values.shape_to_x_m, values.shape_to_y_m],
      errorsM: [values.shape_sigma_from_x_m, values.shape_sigma_from_y_m, values.shape_sigma_to_x_m, values.shape_sigma_to_y_m],
    }
    : {
      ...both,
      centre: [values.shape_x_m, values.shape_y_m],
      radiusM: values.shape_radius_m,
      errorsM: [values.shape_sigma_x_m, values.shape_sigma_y_m, values.shape_sigma_radius_m],
    };
}

// What all that touches comes to, if something does.
function total(numbers) {
  const [x, y, conductanceS] = [numbers.centre_x_m, numbers.centre_y_m, numbers.total_s];
  return conductanceS === null ? null : { forceN: numbers.total_force_n, conductanceS, centreM: [x, y] };
}

// Where nothing was found by a board that reads nothing below a voltage: that, and whether any reading is above it.
function floor(numbers) {
  return numbers.floor_v === null ? null : { floorV: numbers.floor_v, isPressed: numbers.above_floor === 1 };
}

// What the pointer has done, if a contact is one.
function pointer(numbers) {
  const [x, y, clicks] = [numbers.pointer_x_m, numbers.pointer_y_m, numbers.pointer_clicks];
  return clicks === null ? null : { wayM: [x, y], pressed: numbers.pointer_pressed === 1, clicks };
}

function choice(text) {
  const [what, why] = text.split("\n");
  return why === undefined ? null : { what, why };
}

/**
 * An update: the newest frame and what the solver says of it. What is not known is null. Contacts beside a shape are not what touches, and
 * are kept apart from the others.
 */
export function decodeUpdate(buffer, layout) {
  const taker = new Taker(buffer);
  const words = taker.words(layout.words);
  const lengths = taker.words(layout.arrays);
  const count = taker.word();
  const numbers = taker.numbers(layout.numbers);
  const arrays = Object.fromEntries(layout.arrays.map((name) => [name, taker.floats(lengths[name])]));
  const contacts = Array.from({ length: count }, () => contact(taker, layout.contact));
  const kind = layout.shapes[words.shape - 1] ?? null;
  return {
    sequence: words.sequence,
    frames: words.frames,
    timeS: words.time_ms / 1e3,
    electrodes: words.electrodes,
    flags: bitsOf(words.flags).map((bit) => layout.flags[bit]),
    excluded: bitsOf(words.excluded),
    exchanged: bitsOf(words.exchanged),
    residual: numbers.residual,
    certainty: numbers.certainty,
    otherContacts: numbers.other_contacts,
    total: total(numbers),
    floor: floor(numbers),
    ageS: numbers.age_s,
    image: arrays.image_s_per_m2,
    readings: arrays.readings_v,
    course: arrays.course_v,
    pointer: pointer(numbers),
    contacts: kind ? [] : contacts,
    beside: kind ? contacts : [],
    shape: kind ? shape(taker, layout.shape, kind) : null,
    choice: choice(taker.text()),
  };
}

const RETRY_MS = [250, 500, 1000, 2000];

/**
 * The socket to the program, beside the page or in the folder `under` it: connects, and connects again when it is lost. `on` has `setup`, `status`,
 * `update`, each given a message, and `lost`. After each message the program waits for `taken()`.
 */
export class Connection {
  constructor(on, under = "") {
    this.on = on;
    this.under = under;
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
    const address = new URL(`${this.under}socket`, location.href);
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
      this.on.update(decodeUpdate(data, this.layout));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "setup") {
      this.layout = message.layout;
      this.on.setup(message);
    }
    if (message.type === "status") this.on.status(message);
    this.taken();
  }
}
