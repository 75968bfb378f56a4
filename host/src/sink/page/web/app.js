// The live page: takes messages from the program and shows them.

import { ContactTable } from "./contacts.js";
import { MethodSelect } from "./method.js";
import { Figures, linkText, showDetails, showState } from "./panel.js";
import { Picture } from "./picture.js";
import { listenForPresses } from "./press.js";
import { Connection } from "./protocol.js";
import { ReadingsMap } from "./readings.js";
import { listenForTheme, theme } from "./theme.js";
import { Verdict } from "./verdict.js";

const REZERO_SHOWN_MS = 1500;

const { dataset } = document.documentElement;
const rezeroButton = document.getElementById("rezero");
const figures = new Figures();
const table = new ContactTable();
const verdict = new Verdict();
let scene = null;
let picture = null;
let readings = null;
let method = null;
let waiting = null;
let rezeros = null;
let rezeroing = false;
let rezeroTimer = 0;

function start(message) {
  scene = message;
  picture = new Picture(scene, theme());
  readings = new ReadingsMap(scene, theme(), (g, e) => picture.highlight(g, e));
  method = new MethodSelect(scene.solvers, (request) => connection.send(request));
  document.getElementById("plot").classList.toggle("pressable", scene.simulated);
  if (scene.simulated) listenForPresses(picture, (request) => connection.send(request));
  document.getElementById("plot").tabIndex = scene.simulated ? 0 : -1;
  document.getElementById("hint").textContent = scene.simulated
    ? "Simulated board: press with the mouse, or with arrow keys and space." : "";
  showDetails(scene, null);
}

function showStatus(status) {
  figures.show(status);
  showDetails(scene, status.hello);
  showState(status.link.state, linkText(status.link));
  method.show(status.solver, status.link.state === "streaming");
  rezeroButton.disabled = status.link.state !== "streaming";
  showRezero(status);
}

// Every page sees that one has asked for a re-zero, and that it is done.
function showRezero(status) {
  const wasBusy = rezeroing;
  const asked = rezeros !== null && status.rezeros > rezeros;
  ({ rezeroing, rezeros } = status);
  dataset.rezeros = String(rezeros);
  if (rezeroing) rezeroButton.textContent = "Hold still…";
  const done = !rezeroing && (wasBusy || asked);
  if (!done) return;
  rezeroButton.textContent = "Re-zeroed";
  clearTimeout(rezeroTimer);
  rezeroTimer = setTimeout(() => { rezeroButton.textContent = "Re-zero"; }, REZERO_SHOWN_MS);
}

// Draws the newest update when the browser is about to paint, and only then asks for the next: a page that sleeps asks nothing.
function draw(now) {
  const update = waiting;
  waiting = null;
  if (!update || !picture) return;
  picture.show(update, now);
  readings.show(update, now);
  table.show(update, now);
  verdict.show(update, method.explanation, now);
  dataset.sequence = String(update.sequence);
  dataset.received = String(update.frames);
  dataset.updates = String(Number(dataset.updates ?? 0) + 1);
  connection.taken();
}

function update(message) {
  if (!waiting) requestAnimationFrame(draw);
  waiting = message;
}

function lost(reason) {
  waiting = null;
  rezeros = null;
  rezeroButton.disabled = true;
  rezeroButton.textContent = "Re-zero";
  showState("unreachable", reason || "The program does not answer; trying again");
}

function fit() {
  picture?.fit(performance.now());
  readings?.fit(performance.now());
}

function rezero() {
  if (rezeroButton.disabled) return;
  rezeroButton.textContent = "Hold still…";
  connection.send("rezero");
}

const connection = new Connection({ scene: start, status: showStatus, update, lost });

rezeroButton.onclick = rezero;
document.getElementById("rescale").onclick = fit;
document.onkeydown = (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "z") rezero();
  if (event.key === "f") fit();
};
listenForTheme((name) => {
  picture?.recolour(name);
  readings?.recolour(name);
});
new ResizeObserver(() => {
  picture?.layOut();
  readings?.layOut();
}).observe(document.querySelector("main"));
