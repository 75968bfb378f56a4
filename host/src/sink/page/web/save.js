// Files for the person: the picture as PNG, the readings and contacts as CSV, the history as CSV.

const FIELDS = ["id", "x_m", "y_m", "z_m", "conductance_s", "conductance_error_s", "apparent_conductance_s", "radius_m",
  "force_n", "force_error_n", "force_beyond_maximum", "x_error_m", "y_error_m", "correlation"];

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

/** An update as CSV: the contacts, also those beside a shape, an empty line, the readings, a row for each grounded electrode. */
export function csvOf({ contacts, beside = [], readings, electrodes }) {
  const cell = (value) => (value === null ? "" : String(value));
  const force = (c) => [c.forceN, c.forceErrorN, c.forceN === null ? null : Number(c.beyondMaximum)];
  const contact = (c) => [c.id, ...c.place, c.conductanceS, c.errorS, c.apparentS ?? null, c.radiusM, ...force(c), c.xErrorM, c.yErrorM, c.correlation].map(cell).join(",");
  const heads = ["grounded", ...Array.from({ length: electrodes }, (_, e) => `electrode_${e}_v`)];
  const row = (g) => [g, ...readings.slice(g * electrodes, (g + 1) * electrodes)].join(",");
  return `${[FIELDS.join(","), ...[...contacts, ...beside].map(contact), "", heads.join(","), ...Array.from({ length: electrodes }, (_, g) => row(g))].join("\n")}\n`;
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
