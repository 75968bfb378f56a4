// One line for what the program has to say: what was refused, what to know of the baseline, the wires and the calibration, where the recording is. It goes when its
// cause goes, or when it was read.

import { write } from "./words.js";

/** The line. */
export class Notice {
  constructor() {
    this.box = document.getElementById("notice");
    this.text = document.getElementById("notice-text");
    this.read = "";
    document.getElementById("notice-close").onclick = () => {
      this.read = this.text.textContent;
      this.box.hidden = true;
    };
  }

  /** Shows that of a status message. */
  show({ refused, baseline, wires, calibration, recording, solver, playing }) {
    const method = solver?.refused ? `This method cannot be used: ${solver.refused}` : null;
    const damage = playing.damage ? `This recording is damaged: ${playing.damage}` : null;
    const warning = damage ?? baseline ?? wires ?? calibration;
    const told = refused ?? method ?? warning ?? (recording ? `Recording to ${recording}` : "");
    write(this.text, told);
    this.text.title = told;
    this.box.className = refused || method ? "bad" : warning ? "warning" : "";
    if (told !== this.read) this.read = "";
    this.box.hidden = !told || told === this.read;
  }

  /** The program is gone: what it had to say may be so no more. */
  lost() { this.box.hidden = true; }
}
