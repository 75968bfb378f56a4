// The card of the board: who it is, and the settings of its scan.

import { count, fixed } from "./units.js";

const AVERAGES = [1, 2, 4, 8, 16, 32, 64, 128, 256];

function rowOf([name, value]) {
  const [term, text] = [document.createElement("dt"), document.createElement("dd")];
  [term.textContent, text.textContent] = [name, value];
  return [term, text];
}

// Which rows come, and how many frames of them: "adaptive: grounds 5, 10 and the others in turn, 1400 frames/s".
function scanned({ choice, grounds, others }, electrodes, rate) {
  const named = choice === "adaptive" || choice === "four" ? `${choice}: ` : "";
  const turns = others ? " and the others in turn" : "";
  const some = `${grounds.length > 1 ? "grounds" : "ground"} ${grounds.join(", ")}${turns}`;
  const rows = grounds.length === electrodes ? "all grounds in turn" : grounds.length ? some : "whole frames";
  return `${named}${rows}, ${count(rate)} frames/s`;
}

/** Shows the board and asks it for other settings through `send`. */
export class Board {
  listed;

  constructor(setup, send) {
    this.setup = setup;
    this.form = document.getElementById("settings");
    this.average = document.getElementById("average");
    this.settle = document.getElementById("settle");
    this.select = document.getElementById("select");
    this.discard = document.getElementById("discard");
    this.rate = document.getElementById("max-rate");
    this.average.replaceChildren(...AVERAGES.map((many, log2) => new Option(many === 1 ? "none" : String(many), String(log2))));
    this.form.onsubmit = (event) => {
      event.preventDefault();
      this.shown = null;
      send({ settings: this.#asked() });
    };
    this.#showSource();
    this.show({ hello: null, scan: null, statistics: null, playing: { kind: "board" }, learned_from: null });
  }

  #asked() {
    // No limit of the rate is zero.
    const fields = [this.average, this.settle, this.select, this.discard, this.rate];
    const [average, settle, select, discarded, most] = fields.map(({ value }) => Number(value));
    return { average_log2: average, settle_us: settle, select_us: select, discarded, max_frames_per_s: most };
  }

  #showSource() {
    const { name, source, simulated, detector, electrodes } = this.setup;
    const among = document.getElementById("among");
    among.hidden = !name;
    among.querySelector("strong").textContent = name;
    document.getElementById("detector").textContent = `${detector}, ${electrodes.length} electrodes`;
    const badge = document.getElementById("source");
    badge.hidden = false;
    badge.textContent = simulated ? "Simulated" : source;
    badge.title = source;
    badge.classList.toggle("simulated", simulated);
    document.title = `Tactomo live: ${name || (simulated ? "simulated board" : source)}`;
  }

  /** Shows a status message. */
  show({ hello, scan, statistics, playing, learned_from: from }) {
    const { setup } = this;
    this.form.hidden = !hello || playing.kind === "recording";
    const [width, height] = [0, 1].map((k) => fixed((setup.bounds_m[1][k] - setup.bounds_m[0][k]) * 1e3, 0));
    const rows = [
      ["Source", setup.source],
      ["Board", hello ? `${hello.board}, firmware ${hello.firmware}` : "has not answered yet"],
      ["Converter", hello ? `${hello.adc_bits} bits of ${fixed(hello.full_scale_v, 2)} V; drive ${fixed(hello.drive_v, 2)} V` : ""],
      ["Detector", `${setup.detector}, ${width} × ${height} mm, ${setup.electrodes.length} electrodes${from ? `, as learned in ${from}` : ""}`],
      ["Images", `${count(setup.nodes_m.length)} points`],
      // Last, for it may take a line or two.
      ["Scan", hello ? scanned(scan, setup.electrodes.length, statistics.frames_per_s) : ""],
    ];
    this.#list(rows);
    if (hello) this.#showSettings(hello);
  }

  #list(rows) {
    const text = JSON.stringify(rows);
    if (text === this.listed) return;
    this.listed = text;
    document.getElementById("details").replaceChildren(...rows.flatMap(rowOf));
  }

  // Only when the board changed them: what a person is typing stays.
  #showSettings({ averages, settle_us: settle, select_us: select, discarded, max_frames_per_s: most }) {
    const shown = JSON.stringify([averages, settle, select, discarded, most]);
    if (shown === this.shown) return;
    this.shown = shown;
    this.average.value = String(Math.log2(averages));
    this.settle.value = String(settle);
    this.select.value = String(select);
    this.discard.value = String(discarded);
    this.rate.value = most ? String(most) : "";
    this.rate.placeholder = "all";
  }
}
