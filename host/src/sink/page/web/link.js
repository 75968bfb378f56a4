// How the link to the board fares, in the page's first line.

const LINK_TEXT = {
  searching: "Looking for a board",
  waiting: "The link is open; waiting for the board to say hello",
  streaming: "Live",
  silent: "The board answers but sends no frames",
  lost: "The board is lost; trying again",
  ended: "The link has ended",
  finished: "The recording has ended",
  paused: "The recording is paused",
  playing: "Playing a recording",
};

/** What to say of a link: `{state, text}` of a status message. */
export function linkOf({ link: { state, reason }, playing }) {
  if (playing.kind === "recording") {
    const shown = hasEnded({ link: { state }, playing }) ? "finished" : state === "streaming" ? (playing.paused ? "paused" : "playing") : state;
    if (shown in { finished: 0, paused: 0, playing: 0 }) return { state: shown, text: LINK_TEXT[shown] };
  }
  return { state, text: reason ? `${LINK_TEXT[state]}: ${reason}` : LINK_TEXT[state] };
}

/** Whether a recording has come to its end. */
export function hasEnded({ link: { state }, playing }) {
  return playing.kind === "recording" && (state === "ended" || playing.ended);
}

/** Says how the link fares: `state` for colours and tests, `text` for people. */
export function showState(state, text) {
  const line = document.getElementById("state");
  line.dataset.state = state;
  line.title = text;
  document.getElementById("state-text").textContent = text;
  document.body.classList.toggle("stale", !["streaming", "playing", "paused", "finished"].includes(state));
  document.documentElement.dataset.state = state;
}
