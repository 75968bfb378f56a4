// The figures and the details beside the picture, and the line that says how the link fares.

import { count, fixed } from "./units.js";

const LINK_TEXT = {
  searching: "Looking for a board",
  waiting: "The link is open; waiting for the board to say hello",
  streaming: "Live",
  lost: "The board is lost; trying again",
  ended: "The link has ended",
};

const microseconds = (us) => (us < 1000 ? [fixed(us, us < 100 ? 1 : 0), "µs"] : [fixed(us / 1000, 2), "ms"]);

const FIGURES = [
  ["Frame rate", ({ frames_per_s: rate }) => [fixed(rate, rate < 100 ? 1 : 0), "frames/s"]],
  ["Latency, median", ({ latency_us: latency }) => microseconds(latency.p50)],
  ["Latency, 99 %", ({ latency_us: latency }) => microseconds(latency.p99)],
  ["Frames", ({ frames }) => [count(frames), ""]],
  ["Dropped", ({ dropped }) => [count(dropped), ""], ({ dropped }) => dropped > 0],
  ["Corrupt", ({ corrupt }) => [count(corrupt), ""], ({ corrupt }) => corrupt > 0],
];

function element(name, kind, ...children) {
  const made = document.createElement(name);
  made.className = kind;
  made.append(...children);
  return made;
}

/** Figures: frame rate, latency, counts. */
export class Figures {
  constructor() {
    this.cells = FIGURES.map(([name, read, warns]) => {
      const [value, unit] = [element("span", "value", "\u2013"), element("span", "unit")];
      const cell = element("div", "figure", element("dt", "", name), element("dd", "", value, unit));
      return { cell, value, unit, read, warns };
    });
    document.getElementById("figures").replaceChildren(...this.cells.map(({ cell }) => cell));
  }

  /** Shows a status message. */
  show(status) {
    for (const { cell, value, unit, read, warns } of this.cells) {
      [value.textContent, unit.textContent] = read(status.statistics);
      cell.classList.toggle("warning", Boolean(warns?.(status.statistics)));
    }
    const { statistics: { frames, frames_per_s: rate, dropped, corrupt, latency_us: latency } } = status;
    Object.assign(document.documentElement.dataset, {
      frames: String(frames), framesPerS: rate.toFixed(1), dropped: String(dropped), corrupt: String(corrupt),
      latencyP99Us: String(latency.p99),
    });
  }
}

function scanText({ settle_us: settle, averages, max_frames_per_s: most }) {
  const average = averages > 1 ? `${averages} conversions averaged` : "no averaging";
  return `settles ${settle} µs, ${average}${most ? `, at most ${most} frames/s` : ""}`;
}

/** Details that stay: who the board is, what the detector is. */
export function showDetails(scene, hello) {
  const board = hello ? `${hello.board}, firmware ${hello.firmware}` : "not heard yet";
  const adc = hello ? `${hello.adc_bits} bits of ${fixed(hello.full_scale_v, 2)} V; drive ${fixed(hello.drive_v, 2)} V` : "";
  const [width, height] = [0, 1].map((k) => fixed((scene.bounds_m[1][k] - scene.bounds_m[0][k]) * 1e3, 0));
  const rows = [
    ["Source", scene.source],
    ["Board", board],
    ["Converter", adc],
    ["Scan", hello ? scanText(hello) : ""],
    ["Detector", `${scene.detector}, ${width} × ${height} mm, ${scene.electrodes.length} electrodes`],
    ["Images", `${count(scene.nodes_m.length)} nodes`],
  ];
  document.getElementById("details").replaceChildren(
    ...rows.flatMap(([name, value]) => [element("dt", "", name), element("dd", "", value)]),
  );
  document.getElementById("detector").textContent = `${scene.detector}, ${scene.electrodes.length} electrodes`;
  const badge = document.getElementById("source");
  badge.hidden = false;
  badge.textContent = scene.simulated ? "Simulated" : scene.source;
  badge.classList.toggle("simulated", scene.simulated);
  document.title = `Tactomo live: ${scene.simulated ? "simulated board" : scene.source}`;
}

/** Says how the link fares: `state` for colours and tests, `text` for people. */
export function showState(state, text) {
  const line = document.getElementById("state");
  const shown = text || LINK_TEXT[state];
  line.dataset.state = state;
  line.title = shown;
  document.getElementById("state-text").textContent = shown;
  document.body.classList.toggle("stale", state !== "streaming");
  document.documentElement.dataset.state = state;
}

/** The text for a link's state and the reason the program gave. */
export function linkText({ state, reason }) {
  return reason ? `${LINK_TEXT[state]}: ${reason}` : LINK_TEXT[state];
}
