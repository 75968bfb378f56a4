// The panel that guides through a calibration by rubbing.

import { ErrorMap, RubbedMap } from "./calibrate-maps.js";
import { label, line, svg } from "./svg.js";
import { theme } from "./theme.js";
import { count, fixed, millimetres } from "./units.js";

const element = (id) => document.getElementById(id);
const errorText = (errorM) => (errorM < 0.1 ? millimetres(errorM, errorM < 1e-3 ? 2 : 1) : "> 100");

// Where a target is, in words, for those who do not see the picture.
function partOf([x, y], { left, bottom, right, top }) {
  const third = (value, low, high) => Math.min(2, Math.max(0, Math.floor((3 * (value - low)) / (high - low))));
  const names = [["at the lower left", "at the bottom", "at the lower right"], ["at the left", "in the middle", "at the right"], ["at the upper left", "at the top", "at the upper right"]];
  return names[third(y, bottom, top)][third(x, left, right)];
}

// What to do now, in a sentence.
function advice(state, bounds) {
  const { stage, touched, target, keep, saved, used } = state;
  if (stage === "finishing") return "Lift your finger: all presses are being fitted, and the result is tested.";
  if (stage === "done") {
    if (keep) return "Keep the present calibration.";
    if (used) return saved ? "Done. The picture uses the new calibration." : "The picture uses the new calibration. Save it to have it next time.";
    return "The new calibration is better. Use it.";
  }
  if (!target) return "Every part has been pressed. Go on while the error falls, or finish.";
  const how = target.firm ? "firmly" : "lightly";
  return `Press ${how} with one fingertip at the ${target.firm ? "thick" : "thin"} ring, ${partOf(target.at_m, bounds)}${touched ? "." : ": anything else stays off the sensor."}`;
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

  constructor(setup, send, picture) {
    this.picture = picture;
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
    this.picture.aim(calibrating?.target ?? null);
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
    const { stage, share, touched, fitting, errors_m: errorsM, fit, compared, keep, target, saved, used } = state;
    const errorM = errorsM.at(-1);
    Object.assign(dataset, { calibrated: saved ?? "", fits: String(errorsM.length), rubbed: String(share), errorMm: String(1e3 * (errorM ?? NaN)),
      targetMm: JSON.stringify(target?.at_m.map((m) => 1e3 * m) ?? null), targetFirm: String(target?.firm ?? ""), recommended: String(stage === "done" && !keep) });
    element("calibrate-now").textContent = advice(state, this.rubbed);
    element("calibrate-share").textContent = `${fixed(100 * share, 0)} % pressed`;
    element("calibrate-touched").textContent = `${count(touched)} frames${fitting ? ", being fitted" : ""}`;
    this.rubbed.draw(state, theme());
    this.errors.draw(fit, theme());
    element("calibrate-legend").style.background = ErrorMap.legend(theme());
    element("calibrate-error").textContent = errorM === undefined ? "not known yet" : `± ${errorText(errorM)}\u2009mm`;
    element("calibrate-history").replaceChildren(history(errorsM));
    this.#compare(stage, compared);
    this.#note(state);
    const done = stage === "done";
    element("calibrate-finish").hidden = stage !== "rubbing";
    element("calibrate-finish").disabled = errorsM.length === 0;
    element("calibrate-more").hidden = !done;
    element("calibrate-save").hidden = !done || Boolean(keep);
    element("calibrate-save").disabled = Boolean(saved);
    element("calibrate-use").hidden = !done || Boolean(keep);
    element("calibrate-use").disabled = used;
    element("calibrate-use").textContent = used ? "In use" : "Use it";
  }

  // The present calibration and the new one, by the same measures.
  #compare(stage, compared) {
    const table = element("calibrate-compared");
    table.hidden = stage !== "done" || !compared;
    if (table.hidden) return;
    const { presses, residuals, place_errors_m: errorsM } = compared;
    element("calibrate-unused").textContent = `${presses} presses set aside`;
    element("calibrate-rows").replaceChildren(
      row("unexplained, × noise", ...residuals.map((value) => fixed(value, 1))),
      row("error of places", ...errorsM.map((metres) => `± ${errorText(metres)}\u2009mm`)),
    );
  }

  #note({ trouble, keep, fit, saved, stage }) {
    const note = element("calibrate-note");
    const wires = fit?.wires?.map((electrode, channel) => (electrode === channel ? null : `${channel} is at electrode ${electrode}`)).filter(Boolean);
    const told = [
      trouble ?? keep,
      stage === "done" && saved ? `Saved as ${saved}. To begin with it next time: tactomo live --detector ${saved}` : null,
      wires?.length ? `Wires are exchanged, and taken as they are: channel ${wires.join(", ")}.` : null,
      fit?.left_out.length ? `Electrodes ${fit.left_out.join(", ")} are broken or contradict the others, and were left out.` : null,
    ].filter(Boolean);
    note.textContent = told.join(" ");
    note.className = trouble ? "bad" : keep ? "" : "muted";
    note.hidden = !told.length;
  }
}
