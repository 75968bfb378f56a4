// The page of several detectors: a tile for each, which opens the page of that one; and where they have places on a body, that body in space.

import { BodyView } from "./body.js";
import { listenForTheme, theme } from "./theme.js";
import { Tile } from "./tile.js";
import { write } from "./words.js";

const names = await (await fetch("detectors.json")).json();
const known = JSON.stringify(names);
// Time between two looks at whether another program has taken the address (ms).
const LOOK_EVERY = 2000;
const box = document.getElementById("tiles");
const body = new BodyView(theme());
const tiles = names.map((name) => new Tile(name, theme(), {
  known: (tile) => {
    if (body.add(tile)) arrange();
  },
  changed: () => tell(),
  drawn: (tile) => body.take(tile),
}));
box.append(...tiles.map((tile) => tile.element));

// How all of them fare, in the page's first line.
function tell() {
  const live = tiles.filter((tile) => tile.isLive).length;
  const touched = tiles.filter((tile) => tile.isTouched).length;
  const touch = touched ? `, ${touched} touched` : "";
  document.getElementById("state").dataset.state = live === tiles.length ? "streaming" : "waiting";
  write(document.getElementById("state-text"), live === tiles.length ? `${live} detectors live${touch}` : `${live} of ${tiles.length} detectors live${touch}`);
}

// What a tile has besides its picture, and between tiles (pixels): as the style sheet has it.
const [HEAD, GAP] = [56, 12];
const SMALLEST = 150;

// As many columns as make the tiles largest without scrolling.
function arrange() {
  const [width, height] = [box.clientWidth - GAP, window.innerHeight - box.offsetTop - GAP];
  const sideOf = (columns) => Math.min(width / columns - GAP, height / Math.ceil(tiles.length / columns) - GAP - HEAD);
  const best = tiles.map((_, i) => i + 1).reduce((a, b) => (sideOf(b) > sideOf(a) ? b : a), 1);
  const side = Math.floor(sideOf(best));
  // Where all together would be too small, the page scrolls.
  box.style.gridTemplateColumns = side < SMALLEST ? `repeat(auto-fill, minmax(${SMALLEST}px, 1fr))` : `repeat(${best}, ${side}px)`;
}

// Another program may show other detectors, or one alone, whose page is another.
setInterval(async () => {
  if (tiles.every((tile) => tile.isLive)) return;
  const answer = await fetch("detectors.json").catch(() => null);
  if (answer && (!answer.ok || JSON.stringify(await answer.json()) !== known)) location.reload();
}, LOOK_EVERY);

arrange();
window.addEventListener("resize", arrange);
tell();
listenForTheme((name) => {
  tiles.forEach((tile) => tile.recolour(name));
  body.recolour(name);
});
const sizes = new ResizeObserver(() => {
  tiles.forEach((tile) => tile.layOut());
  body.layOut();
});
[...tiles, body].forEach((shown) => sizes.observe(shown.plot));
