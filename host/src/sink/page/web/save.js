// Files for the person: the picture as PNG, the readings and contacts as CSV, the history as CSV.

// Columns of a table, by the names that every output has (docs/solvers.md), and what stands in them. Those of the frame are the same in each row.
const FRAME = {
  sequence: (update) => update.sequence,
  time_s: (update) => update.timeS,
  residual: (update) => update.residual,
  certainty: (update) => update.certainty,
};
const CONTACT = {
  id: (c) => c.id,
  x_m: (c) => c.place[0],
  y_m: (c) => c.place[1],
  z_m: (c) => c.place[2],
  conductance_s: (c) => c.conductanceS,
  apparent_conductance_s: (c) => c.apparentS,
  radius_m: (c) => c.radiusM,
  force_n: (c) => c.forceN,
  force_deviation_n: (c) => c.forceErrorN,
  force_beyond_maximum: (c) => (c.forceN === null ? null : c.beyondMaximum),
  sigma_x_m: (c) => c.xErrorM,
  sigma_y_m: (c) => c.yErrorM,
  correlation: (c) => c.correlation,
  sigma_conductance_s: (c) => c.errorS,
  depth_m: (c) => c.depthM,
  area_m2: (c) => c.areaM2,
};

const stamp = () => new Date().toISOString().slice(0, 19).replace("T", "-").replaceAll(":", "");

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  // The browser reads the blob after the click.
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  document.documentElement.dataset.saved = name;
}

/** Saves canvases that lie over each other, lowest first, on a background. */
export function savePicture(layers, background) {
  const front = layers.at(-1);
  const whole = document.createElement("canvas");
  [whole.width, whole.height] = [front.width, front.height];
  const context = whole.getContext("2d");
  context.fillStyle = background;
  context.fillRect(0, 0, whole.width, whole.height);
  const ratio = front.width / front.clientWidth;
  for (const layer of layers) {
    context.drawImage(layer, layer.offsetLeft * ratio, layer.offsetTop * ratio, layer.clientWidth * ratio, layer.clientHeight * ratio);
  }
  whole.toBlob((blob) => download(blob, `tactomo-${stamp()}.png`));
}

/**
 * An update as one table: a row for each contact, also those beside a shape, or one without; in each the frame's figures before, and after them
 * its readings (V), `readings_v_3_5` of electrode 5 while 3 is grounded. What is not known is empty.
 */
export function csvOf(update) {
  const { contacts, beside = [], readings, electrodes } = update;
  const found = [...contacts, ...beside];
  const places = Array.from(readings, (_, k) => `readings_v_${Math.floor(k / electrodes)}_${k % electrodes}`);
  const frame = Object.values(FRAME).map((of) => of(update));
  const contact = (c) => Object.values(CONTACT).map((of) => c && of(c));
  const row = (c, index) => [...frame, c && index, ...contact(c), ...readings];
  const heads = [...Object.keys(FRAME), "contact", ...Object.keys(CONTACT), ...places];
  const rows = (found.length ? found : [null]).map(row);
  return `${[heads, ...rows].map((cells) => cells.map((cell) => cell ?? "").join(",")).join("\n")}\n`;
}

/** Saves an update as CSV. */
export function saveData(update) {
  download(new Blob([csvOf(update)], { type: "text/csv" }), `tactomo-${stamp()}.csv`);
}

/** A history as CSV: a row for each sample, with the board's time, what all pressed with, and what each contact did; nothing where it was not there. */
export function historyCsv({ lines, turns, unit }) {
  const numbered = [...lines].filter(([id]) => id).sort(([a], [b]) => a - b);
  const columns = numbered.map(([, line]) => new Map(line.map(({ turn, value }) => [turn, value])));
  const suffix = unit.toLowerCase();
  const heads = ["time_s", `total_${suffix}`, ...numbered.map(([id]) => `contact_${id}_${suffix}`)];
  const rows = turns.map(({ turn, timeS, total }) => [timeS, total, ...columns.map((column) => column.get(turn) ?? "")]);
  return `${[heads, ...rows].map((row) => row.join(",")).join("\n")}\n`;
}

/** Saves a history as CSV. */
export function saveHistory(history) {
  download(new Blob([historyCsv(history)], { type: "text/csv" }), `tactomo-history-${stamp()}.csv`);
}
