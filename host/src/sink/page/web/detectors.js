// The page of several detectors: a tile for each, which opens the page of that one; and where they have places on a body, that body in space.

import { BodyView } from "./body.js";
import { Overview } from "./overview.js";
import { offerAddress } from "./share.js";
import { listenForTheme, theme } from "./theme.js";
import { Tile } from "./tile.js";
import { write } from "./words.js";

const names = await (await fetch("detectors.json")).json();
const known = JSON.stringify(names);
// Time between two looks at whether another program has taken the address (ms).
const LOOK_EVERY = 2000;
const box = document.getElementById("tiles");
const body = new BodyView(theme());
const tiles = names.map((name, index) => new Tile([name, index], theme(), {
  known: (tile) => {
    offerAddress(tile.setup);
    if (body.add(tile)) arrange();
  },
  changed: () => tell(),
  drawn: (tile) => body.take(tile),
  shown: (now) => overview.take(now),
  // One for all, that ends where the least sensitive of them does at first.
  scale: ({ floor, max }) => overview.scale.least(floor, max),
}));
box.append(...tiles.map((tile) => tile.element));
const overview = new Overview(tiles, theme());

// How all of them fare, in the page's first line.
function tell() {
  const live = tiles.filter((tile) => tile.isLive).length;
  const touched = tiles.filter((tile) => tile.isTouched).length;
  const recorded = tiles.filter((tile) => tile.recording).length;
  const refused = tiles.find((tile) => tile.refused);
  const touch = `${touched ? `, ${touched} touched` : ""}${recorded ? `, ${recorded} recorded` : ""}${refused ? `; ${refused.name}: ${refused.refused}` : ""}`;
  overview.tell();
  document.getElementById("state").dataset.state = live === tiles.length ? "streaming" : "waiting";
  write(document.getElementById("state-text"), live === tiles.length ? `${live} detectors live${touch}` : `${live} of ${tiles.length} detectors live${touch}`);
}

// What a tile has besides its picture, and between tiles (pixels): as the style sheet has it.
const [HEAD, GAP] = [68, 12];
const SMALLEST = 150;

// As many columns as make the tiles largest without scrolling.
function arrange() {
  const [width, height] = [box.clientWidth - GAP, window.innerHeight - box.offsetTop - GAP - document.getElementById("sum").offsetHeight];
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
  overview.recolour(name);
});
const sizes = new ResizeObserver(() => {
  tiles.forEach((tile) => tile.layOut());
  body.layOut();
  overview.layOut();
});
[...[...tiles, body].map(({ plot }) => plot), document.getElementById("strip-card")].forEach((shown) => sizes.observe(shown));
