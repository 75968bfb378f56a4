// The panel that guides through a calibration by rubbing.

import { ErrorMap, RubbedMap } from "./calibrate-maps.js";
import { label, line, svg } from "./svg.js";
import { theme } from "./theme.js";
import { count, fixed, millimetres } from "./units.js";

// From this share of the detector on, a person is told which part is left.
const MOST_RUBBED = 0.35;
// Share from which it is done, as in `run/calibration`.
const WHOLE = 0.8;
// Cells felt both lightly and firmly, as a share of those felt, below which a person is told to change.
const BOTH = 0.4;

const element = (id) => document.getElementById(id);
const errorText = (errorM) => (errorM < 0.1 ? millimetres(errorM, errorM < 1e-3 ? 2 : 1) : "> 100");

// The third of the detector that has been rubbed least, in words.
function leastRubbed({ cells: [columns, rows], felt }) {
  const ROWS = ["lower", "", "upper"];
  const COLUMNS = ["left", "", "right"];
  const parts = Array.from({ length: 9 }, () => ({ all: 0, done: 0 }));
  felt.forEach((kind, cell) => {
    if (kind === null) return;
    const [x, y] = [Math.floor((3 * (cell % columns)) / columns), Math.floor((3 * Math.floor(cell / columns)) / rows)];
    parts[3 * y + x].all += 1;
    parts[3 * y + x].done += kind > 0 ? 1 : 0;
  });
  const shares = parts.map(({ all, done }) => (all ? done / all : 1));
  const part = shares.indexOf(Math.min(...shares));
  const words = [ROWS[Math.floor(part / 3)], COLUMNS[part % 3]].filter(Boolean).join(" ");
  return words ? `at the ${words}` : "in the middle";
}

// What to do now, in a sentence.
function advice(state) {
  const { stage, share, touched, felt, fit, saved, used } = state;
  if (stage === "finishing") return "Hold on: everything is fitted once more, and compared with before.";
  if (stage === "done") {
    if (saved && used) return "Done. The picture uses the calibrated detector.";
    return saved ? "Saved. Use it here, or start with it next time." : "Done: more rubbing would bring next to nothing. Save it, and use it.";
  }
  if (!touched) return "Rub one fingertip over the whole sensor, now light and now firm.";
  const rubbed = felt.filter((kind) => kind > 0);
  const bothShare = rubbed.filter((kind) => kind === 3).length / Math.max(1, rubbed.length);
  if (share > MOST_RUBBED && bothShare < BOTH) {
    const light = rubbed.filter((kind) => kind === 1).length;
    return `Go over it again, ${light > rubbed.length / 2 ? "more firmly" : "more lightly"}.`;
  }
  if (share > MOST_RUBBED && share < WHOLE) return `Now rub ${leastRubbed(state)}, where the map is empty.`;
  return share < WHOLE || !fit ? "Go on: one fingertip, everywhere, now light and now firm." : "Nearly there: go on while the error falls.";
}

// Expected error after each fit, falling.
function history(errorsM) {
  const [width, height] = [352, 62];
  const made = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": "Expected error after each fit" });
  if (errorsM.length < 2) return made;
  const [low, high] = [Math.min(...errorsM) / 1.3, Math.max(...errorsM) * 1.15].map(Math.log);
  const x = (i) => 34 + ((width - 44) * i) / (errorsM.length - 1);
  const y = (errorM) => height - 6 - ((height - 14) * (Math.log(errorM) - low)) / (high - low);
  const points = errorsM.map((errorM, i) => `${x(i).toFixed(1)},${y(errorM).toFixed(1)}`).join(" ");
  made.append(line(34, height - 5, width - 8, height - 5, "bar"), svg("polyline", { points, class: "fall" }));
  errorsM.forEach((errorM, i) => made.append(svg("circle", { cx: x(i), cy: y(errorM), r: 3, class: "fall-point" })));
  made.append(label(30, y(errorsM[0]) + 4, errorText(errorsM[0]), "fall-text", "end"));
  return made;
}

function row(what, before, after) {
  const made = document.createElement("tr");
  for (const [name, text] of [["th", what], ["td", before], ["td", after]]) {
    const cell = document.createElement(name);
    cell.textContent = text;
    made.append(cell);
  }
  return made;
}

/** The panel; asks through `send`. */
export class CalibratePanel {
  state;

  constructor(setup, send) {
    this.send = (what) => send({ calibrate: what });
    this.card = element("calibrate-card");
    this.button = element("calibrate");
    this.rubbed = new RubbedMap("calibrate-rubbed", setup);
    this.errors = new ErrorMap("calibrate-errors", setup);
    this.drawn = "";
    element("calibrate-close").onclick = () => this.send("end");
    element("calibrate-finish").onclick = () => this.send("finish");
    element("calibrate-more").onclick = () => this.send("begin");
    element("calibrate-save").onclick = () => this.send("save");
    element("calibrate-use").onclick = () => this.send("use");
  }

  /** Opens the panel, or closes it, for all pages. */
  toggle() {
    if (!this.button.disabled) this.send(this.state ? "end" : "begin");
  }

  /** Shows a status message. */
  show({ calibrating, learned, link }) {
    element("learned").textContent = learned ? `${learned[0].toUpperCase()}${learned.slice(1)}` : "";
    this.button.disabled = !calibrating && link.state !== "streaming";
    this.button.setAttribute("aria-pressed", String(Boolean(calibrating)));
    const text = JSON.stringify(calibrating);
    if (text === this.drawn) return;
    [this.drawn, this.state] = [text, calibrating];
    this.draw();
  }

  /** Draws it, in the colours of the theme. */
  draw() {
    const { state } = this;
    this.card.hidden = !state;
    document.querySelector("main").classList.toggle("calibrating", Boolean(state));
    const { dataset } = document.documentElement;
    dataset.calibrating = state?.stage ?? "";
    if (!state) return;
    const { stage, share, touched, fitting, errors_m: errorsM, fit, trouble, saved, used } = state;
    const errorM = errorsM.at(-1);
    Object.assign(dataset, { calibrated: saved ?? "", fits: String(errorsM.length), rubbed: String(share), errorMm: String(1e3 * (errorM ?? NaN)) });
    element("calibrate-now").textContent = advice(state);
    element("calibrate-share").textContent = `${fixed(100 * share, 0)} % rubbed`;
    element("calibrate-touched").textContent = `${count(touched)} frames${fitting ? ", fitting…" : ""}`;
    this.rubbed.draw(state, theme());
    this.errors.draw(fit, theme());
    element("calibrate-legend").style.background = ErrorMap.legend(theme());
    element("calibrate-error").textContent = errorM === undefined ? "not known yet" : `± ${errorText(errorM)}\u2009mm`;
    element("calibrate-history").replaceChildren(history(errorsM));
    this.#compare(stage, fit);
    this.#note(trouble, fit, saved, stage);
    const done = stage === "done";
    element("calibrate-finish").hidden = stage !== "rubbing";
    element("calibrate-finish").disabled = errorsM.length === 0;
    element("calibrate-more").hidden = !done;
    element("calibrate-save").hidden = !done;
    element("calibrate-save").disabled = Boolean(saved);
    element("calibrate-use").hidden = !done;
    element("calibrate-use").disabled = used;
    element("calibrate-use").textContent = used ? "In use" : "Use it";
  }

  #compare(stage, fit) {
    const table = element("calibrate-compared");
    table.hidden = stage !== "done" || !fit;
    if (table.hidden) return;
    const rows = [];
    if (fit.residuals) rows.push(row("residual", ...fit.residuals.map((value) => `${fixed(value, 1)} × noise`)));
    if (fit.place_errors_m) rows.push(row("places", ...fit.place_errors_m.map((metres) => `± ${errorText(metres)}\u2009mm`)));
    element("calibrate-rows").replaceChildren(...rows);
  }

  #note(trouble, fit, saved, stage) {
    const note = element("calibrate-note");
    const wires = fit?.wires?.map((electrode, channel) => (electrode === channel ? null : `${channel} is at electrode ${electrode}`)).filter(Boolean);
    const told = [
      trouble,
      stage === "done" && saved ? `Written to ${saved}: start with --detector ${saved}` : null,
      wires?.length ? `Wires are exchanged, and taken as they are: channel ${wires.join(", ")}.` : null,
      fit?.left_out.length ? `Electrodes ${fit.left_out.join(", ")} are broken or contradict the others, and were left out.` : null,
    ].filter(Boolean);
    note.textContent = told.join(" ");
    note.className = trouble ? "bad" : "muted";
    note.hidden = !told.length;
  }
}
