// The controls of a recording: play, seek, speed, loop; and its calm end.

import { hasEnded } from "./link.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 10, "max"];
// A wish is shown this long before the program has answered it.
const WISH_STAYS_MS = 500;

const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

/** The bar under the picture; asks through `send`. */
export class Transport {
  bar; playButton; position; seek; length; speed; loop; ended;

  constructor(send) {
    this.send = send;
    const find = (id) => document.getElementById(id);
    [this.bar, this.playButton, this.position, this.seek] = ["transport", "play", "position", "seek"].map(find);
    [this.length, this.speed, this.loop, this.ended] = ["length", "speed", "loop", "ended"].map(find);
    this.speed.replaceChildren(...SPEEDS.map((speed) => new Option(speed === "max" ? "as fast as can be" : `${speed} ×`, String(speed))));
    this.asked = -Infinity;
    this.paused = false;
    this.atEnd = false;
    this.playButton.onclick = () => this.toggle();
    find("again").onclick = () => this.#playAgain();
    this.seek.oninput = () => this.#ask({ seek_s: Number(this.seek.value) });
    this.speed.onchange = () => this.#ask({ speed: this.speed.value === "max" ? null : Number(this.speed.value) });
    this.loop.onclick = () => this.#ask({ loop: this.loop.getAttribute("aria-pressed") !== "true" });
  }

  /** Whether there is a recording to control. */
  get isThere() { return !this.bar.hidden; }

  /** Holds the recording, or goes on. */
  toggle() {
    if (this.atEnd) this.#playAgain();
    else this.#ask({ pause: !this.paused });
  }

  /** Shows a status message. */
  show(status) {
    const { playing } = status;
    const recorded = playing.kind === "recording";
    this.bar.hidden = !recorded;
    this.atEnd = hasEnded(status);
    this.ended.hidden = !this.atEnd;
    if (!recorded) return;
    this.paused = playing.paused;
    this.playButton.dataset.shows = playing.paused || this.atEnd ? "play" : "pause";
    this.length.textContent = clock(playing.length_s);
    if (performance.now() - this.asked < WISH_STAYS_MS) return;
    this.seek.max = String(playing.length_s);
    this.seek.value = String(playing.position_s);
    this.position.textContent = clock(playing.position_s);
    this.#showSpeed(playing.speed ?? "max");
    this.loop.setAttribute("aria-pressed", String(playing.looped));
  }

  // A speed of the command line may be none of the list.
  #showSpeed(speed) {
    const text = String(speed);
    if (![...this.speed.options].some(({ value }) => value === text)) this.speed.add(new Option(`${text} ×`, text));
    this.speed.value = text;
  }

  #playAgain() {
    this.#ask({ seek_s: 0 });
    this.#ask({ pause: false });
  }

  #ask(request) {
    this.asked = performance.now();
    this.send(request);
  }
}
