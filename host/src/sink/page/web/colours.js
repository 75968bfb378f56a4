// Colour maps that are perceptually even: their lightness runs one way, and equal steps of the value are equal distances in
// Oklab (B. Ottosson, "A perceptual color space for image processing", 2020). Computed once, at load.

const STEPS = 256;

// Control points: lightness, chroma, hue in degrees.
const EMBER_DARK = [
  [0.19, 0.02, 275], [0.33, 0.13, 292], [0.48, 0.18, 335], [0.64, 0.19, 385], [0.8, 0.15, 427], [0.96, 0.08, 462],
];
const EMBER_LIGHT = [
  [0.985, 0.006, 455], [0.9, 0.09, 440], [0.77, 0.15, 415], [0.61, 0.2, 380], [0.44, 0.17, 335], [0.27, 0.11, 292],
];
const SEA_DARK = [[0.22, 0.015, 260], [0.38, 0.07, 245], [0.56, 0.09, 220], [0.75, 0.1, 185], [0.95, 0.06, 160]];
const SEA_LIGHT = [[0.985, 0.004, 170], [0.87, 0.06, 175], [0.7, 0.1, 195], [0.51, 0.1, 230], [0.3, 0.08, 260]];

const lab = ([lightness, chroma, degrees]) => {
  const hue = (degrees * Math.PI) / 180;
  return [lightness, chroma * Math.cos(hue), chroma * Math.sin(hue)];
};

// Catmull-Rom through `points` at `t` in 0..1.
function along(points, t) {
  const place = t * (points.length - 1);
  const i = Math.min(Math.floor(place), points.length - 2);
  const f = place - i;
  const [b, c] = [points[i], points[i + 1]];
  const a = points[i - 1] ?? b.map((v, k) => 2 * v - c[k]);
  const d = points[i + 2] ?? c.map((v, k) => 2 * v - b[k]);
  return b.map((v, k) =>
    v + 0.5 * f * (c[k] - a[k] + f * (2 * a[k] - 5 * v + 4 * c[k] - d[k] + f * (3 * (v - c[k]) + d[k] - a[k]))));
}

/** @param {number[]} colour */
function linearRgb([lightness, a, b]) {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
}

const inGamut = (colour) => linearRgb(colour).every((v) => v >= -1e-4 && v <= 1 + 1e-4);

// The colour of the same lightness and hue with the most chroma that the screen can show.
function clip([lightness, a, b]) {
  let [low, high] = [0, 1];
  if (inGamut([lightness, a, b])) return [lightness, a, b];
  for (let i = 0; i < 20; i += 1) {
    const middle = (low + high) / 2;
    if (inGamut([lightness, middle * a, middle * b])) low = middle;
    else high = middle;
  }
  return [lightness, low * a, low * b];
}

const gamma = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
const byte = (v) => Math.round(255 * Math.min(1, Math.max(0, gamma(v))));

// The curve through the control points, resampled so that all its steps are equally long.
function evenly(control) {
  const fine = Array.from({ length: 2049 }, (_, i) => clip(along(control.map(lab), i / 2048)));
  const length = [0];
  for (let i = 1; i < fine.length; i += 1) {
    length.push(length[i - 1] + Math.hypot(...fine[i].map((v, k) => v - fine[i - 1][k])));
  }
  let i = 0;
  return Array.from({ length: STEPS }, (_, step) => {
    const wanted = (step / (STEPS - 1)) * length.at(-1);
    while (i < fine.length - 2 && length[i + 1] < wanted) i += 1;
    const f = Math.min(1, (wanted - length[i]) / (length[i + 1] - length[i]));
    return fine[i].map((v, k) => v + f * (fine[i + 1][k] - v));
  });
}

// 256 pixels as a canvas stores them.
function table(control) {
  const bytes = new Uint8ClampedArray(STEPS * 4);
  evenly(control).forEach((colour, i) => bytes.set([...linearRgb(colour).map(byte), 255], 4 * i));
  return new Uint32Array(bytes.buffer);
}

const MAPS = {
  light: { image: table(EMBER_LIGHT), readings: table(SEA_LIGHT) },
  dark: { image: table(EMBER_DARK), readings: table(SEA_DARK) },
};

/** The colour maps of a theme, `light` or `dark`: tables of 256 canvas pixels for the image and for the readings. */
export const colourMaps = (theme) => MAPS[theme];

/** A pixel of a colour map for CSS. */
export function css(pixel) {
  const [r, g, b] = new Uint8Array(Uint32Array.of(pixel).buffer);
  return `rgb(${r} ${g} ${b})`;
}
