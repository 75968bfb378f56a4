// How the link to the board fares, in the page's first line.

import { write } from "./words.js";

const LINK_TEXT = {
  searching: "Looking for a board: connect it by USB",
  absent: "Waiting for the board",
  waiting: "A board is connected and has not answered yet",
  streaming: "Live",
  silent: "The board answers and sends no readings",
  lost: "The board is gone; looking for it again",
  ended: "The link has ended",
  finished: "The recording has ended",
  paused: "The recording is paused",
  playing: "Playing a recording",
};

/** What to say of a link: `{state, text}` of a status message. */
export function linkOf({ link: { state, reason }, playing }) {
  const shown = recordingState(state, playing);
  if (shown) return { state: shown, text: LINK_TEXT[shown] };
  return { state, text: reason ? `${LINK_TEXT[state]}: ${reason}` : LINK_TEXT[state] };
}

function recordingState(state, playing) {
  if (hasEnded({ link: { state }, playing })) return "finished";
  if (playing.kind !== "recording" || state !== "streaming") return null;
  return playing.paused ? "paused" : "playing";
}

/** Whether a recording has come to its end. */
export function hasEnded({ link: { state }, playing }) {
  return playing.kind === "recording" && (state === "ended" || playing.ended);
}

// States in which what is shown is of now, or what a person chose to look at.
const FRESH = ["streaming", "playing", "paused", "finished"];

/** Says how the link fares: `state` for colours and tests, `text` for people; returns whether what is shown is old. */
export function showState(state, text) {
  const line = document.getElementById("state");
  line.dataset.state = state;
  line.title = text;
  write(document.getElementById("state-text"), text);
  const stale = !FRESH.includes(state);
  document.body.classList.toggle("stale", stale);
  document.documentElement.dataset.state = state;
  return stale;
}
