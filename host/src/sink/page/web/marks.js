// The contacts on the picture: circles that grow with the conductance, or of the radius where that is known; ellipses of the
// uncertainty; and the key to the sizes.

import { label, svg } from "./svg.js";
import { withPrefix } from "./units.js";

const HUES = 8;
// Radius of a circle (pixels): of no conductance, and added for each decade above a hundredth of the sheet conductance.
const LEAST = 7;
const PER_DECADE = 7;
const SMALLEST_SHARE = 0.01;
// The ellipse holds the true place in 86 of 100 frames: two standard errors. Smaller ones (pixels) would hide in the centre's dot.
const DEVIATIONS = 2;
const SMALLEST_ELLIPSE = 4;
// Larger ones say nothing, and a browser takes seconds for their dashes.
const LARGEST_ELLIPSE = 2000;
// Place for a value beside a contact (pixels).
const LABEL_WIDTH = 86;

/** The class that colours a contact: the same for the same number. */
export const hueOf = (id) => (id ? `hue-${(id - 1) % HUES}` : "hue-none");

/** What a contact presses with, for people: newtons where they are known. */
export const strengthOf = ({ forceN, conductanceS }) => (forceN === null ? withPrefix(conductanceS, "S") : withPrefix(forceN, "N"));

// Radius of the circle of a conductance, in pixels.
const sizeOf = (conductanceS, sheetS) => LEAST + PER_DECADE * Math.log10(1 + Math.max(0, conductanceS) / (SMALLEST_SHARE * sheetS));

/** The half axes (m) of one standard error and the direction of the longer (degrees, anticlockwise), or null. */
export function ellipseOf({ xErrorM, yErrorM, correlation }) {
  if (xErrorM === null || yErrorM === null) return null;
  const [xx, yy, xy] = [xErrorM ** 2, yErrorM ** 2, (correlation ?? 0) * xErrorM * yErrorM];
  const [mean, half] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  return {
    longM: Math.sqrt(mean + half), shortM: Math.sqrt(Math.max(0, mean - half)),
    degrees: (Math.atan2(2 * xy, xx - yy) / 2) * (180 / Math.PI),
  };
}

function ellipse(contact, perM) {
  const of = ellipseOf(contact);
  const long = of ? DEVIATIONS * of.longM * perM : 0;
  if (long < SMALLEST_ELLIPSE || long > LARGEST_ELLIPSE) return [];
  const [rx, ry] = [of.longM, of.shortM].map((m) => (DEVIATIONS * m * perM).toFixed(1));
  return [svg("ellipse", { class: "uncertainty", rx, ry, transform: `rotate(${(-of.degrees).toFixed(1)})` })];
}

/** The mark of a contact about its centre; `perM` pixels a metre, `room` pixels to the right of it. */
export function markOf(contact, sheetS, perM, room) {
  const known = contact.radiusM !== null;
  const r = known ? contact.radiusM * perM : sizeOf(contact.conductanceS, sheetS);
  const [x, anchor] = room > r + LABEL_WIDTH ? [r + 6, "start"] : [-r - 6, "end"];
  const text = label(x, 0.5, "", "contact-label", anchor);
  if (contact.id) text.append(svg("tspan", { class: "contact-id" }, `${contact.id}`), "\u2002");
  text.append(strengthOf(contact));
  return svg("g", { class: `contact ${hueOf(contact.id)}` },
    svg("circle", { class: known ? "disc known" : "disc", r: r.toFixed(1) }), ...ellipse(contact, perM),
    svg("circle", { class: "centre", r: 2.2 }), text);
}

/** The key to the circles' sizes: a circle for each decade, from `top` down about `x`, in at most `height` pixels. */
export function sizeKey(sheetS, x, top, height) {
  const most = Math.floor(Math.log10(sheetS)) + 1;
  const decades = [most, most - 1, most - 2, most - 3].map((power) => 10 ** power);
  const sizes = decades.map((value) => sizeOf(value, sheetS));
  const gap = 34;
  const needed = sizes.reduce((sum, size) => sum + 2 * size + gap, 0);
  let y = top + Math.max(0, (height - needed) / 2);
  return decades.flatMap((value, i) => {
    y += 2 * sizes[i] + gap;
    return [svg("circle", { class: "key", cx: x, cy: y - gap - sizes[i], r: sizes[i].toFixed(1) }),
      label(x, y - gap + 14, withPrefix(value, "S", 1), "tick-text")];
  });
}
