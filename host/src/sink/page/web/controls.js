// Buttons and keys.

const REZERO_SHOWN_MS = 1500;

/** Calls what is pressed: `actions` by the names of the buttons. */
export function listenForActions(actions) {
  const KEYS = {
    p: actions.pause, s: actions["save-picture"], c: actions["save-data"], r: actions.record, m: actions.mark, a: actions.rescale, z: actions.rezero,
    k: actions.calibrate, f: actions.full, 3: actions.view, "?": actions.keys, h: actions["save-history"],
    "+": actions["more-gain"], "=": actions["more-gain"], "-": actions["less-gain"], t: () => document.getElementById("theme").click(),
  };
  for (const [name, act] of Object.entries(actions)) {
    const button = document.getElementById(name);
    if (button) button.onclick = act;
  }
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || /** @type {Element} */ (event.target).matches("input, select")) return;
    KEYS[event.key.toLowerCase()]?.();
  });
}

/** The record button, and the one that sets marks meanwhile; they ask through `send`. */
export class RecordButton {
  constructor(send) {
    this.send = send;
    this.button = document.getElementById("record");
    this.markButton = document.getElementById("mark");
  }

  toggle() { if (!this.button.disabled) this.send({ record: !this.recording }); }

  /** Sets a mark in the recording. */
  mark() { if (!this.markButton.disabled) this.send({ mark: "" }); }

  /** Shows a status message. */
  show({ recording, marks, playing }) {
    this.recording = Boolean(recording);
    this.markButton.hidden = playing.kind === "recording";
    this.markButton.disabled = !recording;
    this.markButton.textContent = marks ? `Mark (${marks})` : "Mark";
    this.button.hidden = playing.kind === "recording";
    this.button.setAttribute("aria-pressed", String(this.recording));
    this.button.textContent = recording ? "Stop" : "Record";
  }
}

/** The re-zero button. Every page sees that one has asked for it, and that it is done. */
export class RezeroButton {
  constructor(send) {
    this.send = send;
    this.button = document.getElementById("rezero");
    this.rezeros = null;
    this.busy = false;
  }

  press() {
    if (this.button.disabled) return;
    this.button.textContent = "Hold still…";
    this.send("rezero");
  }

  /** Shows a status message. */
  show({ rezeroing, rezeros, link }) {
    this.button.disabled = link.state !== "streaming";
    const done = !rezeroing && (this.busy || (this.rezeros !== null && rezeros > this.rezeros));
    [this.busy, this.rezeros] = [rezeroing, rezeros];
    document.documentElement.dataset.rezeros = String(rezeros);
    if (rezeroing) this.button.textContent = "Hold still…";
    if (!done) return;
    this.button.textContent = "Re-zeroed";
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { this.button.textContent = "Re-zero"; }, REZERO_SHOWN_MS);
  }

  /** The program is gone. */
  lost() {
    this.rezeros = null;
    this.button.disabled = true;
    this.button.textContent = "Re-zero";
  }
}
