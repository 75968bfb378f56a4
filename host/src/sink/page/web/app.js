// The live page: takes messages from the program and shows them.

import { Board } from "./board.js";
import { CalibratePanel } from "./calibrate.js";
import { ContactTable } from "./contacts.js";
import { listenForActions, RecordButton, RezeroButton } from "./controls.js";
import { Figures } from "./figures.js";
import { GainSelect } from "./gain.js";
import { History } from "./history.js";
import { linkOf, showState } from "./link.js";
import { MethodSelect } from "./method.js";
import { Picture } from "./picture.js";
import { PointerPanel } from "./pointer.js";
import { listenForPresses } from "./press.js";
import { Connection } from "./protocol.js";
import { Notice } from "./notice.js";
import { ReadingsMap } from "./readings.js";
import { saveData, saveHistory, savePicture } from "./save.js";
import { offerAddress } from "./share.js";
import { Simulation } from "./simulation.js";
import { StripChart } from "./strip.js";
import { listenForTheme, theme } from "./theme.js";
import { Told } from "./told.js";
import { Totals } from "./totals.js";
import { Transport } from "./transport.js";
import { Verdict } from "./verdict.js";
import { VibrationPanel } from "./vibration.js";

// A sensor so many times as wide as high has what is said of it above, not beside.
const WIDE = 1.3;

const { dataset } = document.documentElement;
const send = (request) => connection.send(request);
const figures = new Figures();
const notice = new Notice();
const verdict = new Verdict();
const vibration = new VibrationPanel();
const transport = new Transport(send);
const recordButton = new RecordButton(send);
const rezeroButton = new RezeroButton(send);
// What needs to know the detector.
let parts = null;
let waiting = null;
let shown = null;
let held;
let frozen = false;

function start(setup) {
  const text = JSON.stringify(setup);
  if (parts) {
    // The same program again, or another run of it, perhaps with another detector.
    if (text !== parts.text) location.reload();
    return;
  }
  const told = new Told();
  const picture = new Picture(setup, theme(), told);
  const history = new History();
  parts = {
    text, told, picture, history, strip: new StripChart(history), table: new ContactTable(setup), board: new Board(setup, send),
    readings: new ReadingsMap(setup, theme(), (g, e) => picture.highlight(g, e)),
    method: new MethodSelect(setup.solvers, send), simulation: new Simulation(setup, send),
    calibrate: new CalibratePanel(setup, send, picture), pointer: new PointerPanel(setup), totals: new Totals(),
    gain: new GainSelect(picture.scale.floor, (end) => picture.endAt(end, performance.now())),
  };
  const [[left, bottom], [right, top]] = setup.bounds_m;
  document.getElementById("picture").classList.toggle("wide", right - left > WIDE * (top - bottom));
  offerAddress(setup);
  const plot = document.getElementById("plot");
  plot.classList.toggle("pressable", setup.simulated);
  plot.tabIndex = setup.simulated ? 0 : -1;
  if (setup.simulated) listenForPresses(picture, send);
  document.getElementById("hint").textContent = setup.simulated
    ? "Press on the detector: mouse, fingers, or arrow keys and space. Shift-click leaves a finger down." : "";
}

function showStatus(status) {
  const { state, text } = linkOf(status);
  if (showState(state, text)) verdict.hold();
  for (const part of [figures, vibration, transport, recordButton, rezeroButton, parts.board, parts.simulation, parts.calibrate]) part.show(status);
  if (parts.method.show(status.solver, status.link.state === "streaming")) parts.picture.fitNext();
  document.getElementById("pause").hidden = transport.isThere;
  notice.show(status);
}

// Draws the newest update when the browser is about to paint, and only then asks for the next: a page that sleeps asks nothing.
function draw(now) {
  const update = waiting;
  waiting = null;
  if (!update || !parts) return;
  dataset.received = String(update.frames);
  vibration.take(update);
  if (!frozen) show(update, now);
  connection.taken();
}

function show(update, now) {
  parts.history.take(update, now);
  parts.readings.show(update, now);
  parts.strip.draw(now);
  parts.pointer.show(update, now);
  vibration.draw(now);
  reveal(update, now);
  dataset.sequence = String(update.sequence);
  dataset.updates = String(Number(dataset.updates ?? 0) + 1);
}

// Draws what is said of an update, and what it says once that may be told.
function reveal(update, now) {
  const turn = parts.told.take(update, now);
  clearTimeout(held);
  if (turn === "held") {
    // Perhaps no other comes.
    held = setTimeout(() => frozen || reveal(update, performance.now()), parts.told.left(now));
    return;
  }
  shown = update;
  parts.picture.show(update, now);
  if (turn === "told") tell(update);
}

// What is written of it.
function tell(update) {
  parts.table.show(update);
  parts.totals.show(update);
  parts.readings.tell();
  verdict.show(update, parts.method.explanation);
}

function update(message) {
  if (!waiting) requestAnimationFrame(draw);
  waiting = message;
}

function lost(reason) {
  waiting = null;
  rezeroButton.lost();
  notice.lost();
  showState("unreachable", reason || "The program does not answer; trying again");
  verdict.hold();
}

// A recording is held; live frames keep coming, and only the picture stands still.
function pause() {
  if (transport.isThere) {
    transport.toggle();
    return;
  }
  frozen = !frozen;
  const button = document.getElementById("pause");
  button.textContent = frozen ? "Resume" : "Pause";
  button.setAttribute("aria-pressed", String(frozen));
  document.getElementById("frozen").hidden = !frozen;
  dataset.frozen = String(frozen);
}

function look(name) {
  parts?.picture.look(name);
  document.getElementById("view-flat").setAttribute("aria-pressed", String(name === "flat"));
  document.getElementById("view-space").setAttribute("aria-pressed", String(name === "space"));
}

// A phone may have none.
document.getElementById("full").hidden = !document.fullscreenEnabled;

function fullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.getElementById("picture").requestFullscreen?.().catch(() => {});
}

const connection = new Connection({ setup: start, status: showStatus, update, lost });

listenForActions({
  pause,
  "save-picture": () => parts && savePicture(parts.picture.layers(), parts.picture.colours.card),
  "save-data": () => shown && saveData(shown),
  "save-history": () => parts && saveHistory(parts.history),
  "more-gain": () => parts?.gain.step(1, parts.picture.scale.max),
  "less-gain": () => parts?.gain.step(-1, parts.picture.scale.max),
  record: () => recordButton.toggle(),
  mark: () => recordButton.mark(),
  rescale: () => {
    parts?.gain.release();
    parts?.picture.fit(performance.now());
    parts?.readings.fit(performance.now());
  },
  rezero: () => rezeroButton.press(),
  calibrate: () => {
    // The target is on the flat picture.
    look("flat");
    parts?.calibrate.toggle();
  },
  full: fullScreen,
  leave: fullScreen,
  keys: () => document.getElementById("help").showModal(),
  view: () => look(parts?.picture.looking === "flat" ? "space" : "flat"),
  "view-flat": () => look("flat"),
  "view-space": () => look("space"),
});
listenForTheme((name) => {
  parts?.picture.recolour(name);
  parts?.readings.recolour(name);
  parts?.strip.recolour();
  parts?.pointer.recolour();
  vibration.recolour();
  parts?.calibrate.draw();
});
const sizes = new ResizeObserver(() => {
  parts?.picture.layOut();
  parts?.readings.layOut();
  parts?.strip.layOut();
  parts?.pointer.layOut();
  vibration.layOut();
});
for (const id of ["plot", "readings", "strip-card", "vibration-card"]) sizes.observe(document.getElementById(id));
