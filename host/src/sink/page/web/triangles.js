// Draws triangles with a depth buffer into the pixels of an image. No library, no graphics processor: it looks the same and
// works everywhere.

const LIGHTS = 64;
/** Share of brightness up to which it is that of the colour; above, colours turn white: they shine. */
export const MATT = 0.8;
const MOST_WHITE = 0.35;

/** An image with depth. */
export class DepthImage {
  width; height;

  constructor(width, height) {
    [this.width, this.height] = [width, height];
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.depth = new Float32Array(width * height);
  }

  clear() {
    this.pixels.fill(0);
    this.depth.fill(Infinity);
  }

  /** Keeps what is drawn now, for `restore`. */
  keep() { this.kept = { pixels: this.pixels.slice(), depth: this.depth.slice() }; }

  /** Draws what was kept, and nothing else. */
  restore() {
    this.pixels.set(this.kept.pixels);
    this.depth.set(this.kept.depth);
  }

  /**
   * Draws triangles between points of `x`, `y` (pixels) and `z` (depth, larger is farther), coloured by `share` (0 to 1) in
   * `shades`, as `shadesOf` makes them, at the brightness `light` (0 to 1).
   */
  draw(triangles, { x, y, z, share, light }, shades) {
    const { width, height, pixels, depth } = this;
    const steps = shades.length / LIGHTS - 1;
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
      const area = (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]);
      if (area === 0) continue;
      const top = Math.max(0, Math.ceil(Math.min(y[a], y[b], y[c])));
      const bottom = Math.min(height - 1, Math.floor(Math.max(y[a], y[b], y[c])));
      const left = Math.max(0, Math.ceil(Math.min(x[a], x[b], x[c])));
      const right = Math.min(width - 1, Math.floor(Math.max(x[a], x[b], x[c])));
      // Weights of b and c change evenly from pixel to pixel.
      const [ux, uy] = [(y[c] - y[a]) / area, -(x[c] - x[a]) / area];
      const [vx, vy] = [-(y[b] - y[a]) / area, (x[b] - x[a]) / area];
      const [zb, zc, sb, sc] = [z[b] - z[a], z[c] - z[a], share[b] - share[a], share[c] - share[a]];
      const [lb, lc] = [light[b] - light[a], light[c] - light[a]];
      for (let row = top; row <= bottom; row += 1) {
        let u = ux * (left - x[a]) + uy * (row - y[a]);
        let v = vx * (left - x[a]) + vy * (row - y[a]);
        for (let column = left, at = row * width + left; column <= right; column += 1, at += 1, u += ux, v += vx) {
          if (u < -1e-4 || v < -1e-4 || u + v > 1.0002) continue;
          const far = z[a] + u * zb + v * zc;
          if (far >= depth[at]) continue;
          depth[at] = far;
          const shade = Math.min(LIGHTS - 1, Math.max(0, ((light[a] + u * lb + v * lc) * LIGHTS) | 0));
          const step = Math.min(steps, Math.max(0, ((share[a] + u * sb + v * sc) * steps + 0.5) | 0));
          pixels[at] = shades[shade * (steps + 1) + step];
        }
      }
    }
  }

  /** Whether a point of this depth at a pixel is before what was drawn there, but for `slack`. */
  isVisible(x, y, z, slack) {
    const [column, row] = [Math.round(x), Math.round(y)];
    if (column < 0 || row < 0 || column >= this.width || row >= this.height) return false;
    return z <= this.depth[row * this.width + column] + slack;
  }
}

/** Least depth of triangles between points of `x`, `y` (pixels) and `z` at a pixel; infinite off all of them. */
export function depthAt(triangles, { x, y, z }, px, py) {
  let least = Infinity;
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const area = (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]);
    if (area === 0) continue;
    const u = ((y[c] - y[a]) * (px - x[a]) - (x[c] - x[a]) * (py - y[a])) / area;
    const v = ((x[b] - x[a]) * (py - y[a]) - (y[b] - y[a]) * (px - x[a])) / area;
    if (u >= 0 && v >= 0 && u + v <= 1) least = Math.min(least, z[a] + u * (z[b] - z[a]) + v * (z[c] - z[a]));
  }
  return least;
}

// Share of the colours up to which `lift` reaches.
const LIFTED = 0.35;

/**
 * Canvas pixels for each brightness, `LIGHTS` of them, of each of `colours`. `darkest` is the factor of the least brightness, `lift`
 * what is added where nothing presses (0 to 255), so that a shape shows before a background of the same colour.
 */
export function shadesOf(colours, { darkest, lift }) {
  const shades = new Uint32Array(LIGHTS * colours.length);
  const bytes = new Uint8Array(shades.buffer);
  const source = new Uint8Array(colours.buffer);
  for (let light = 0; light < LIGHTS; light += 1) {
    const share = light / (LIGHTS - 1);
    const factor = darkest + (1 - darkest) * Math.min(1, share / MATT);
    const white = MOST_WHITE * Math.max(0, (share - MATT) / (1 - MATT));
    for (let i = 0; i < source.length; i += 1) {
      const added = lift * Math.max(0, 1 - i / source.length / LIFTED);
      bytes[light * source.length + i] = i % 4 === 3 ? 255 : Math.min(255, (source[i] + added) * factor * (1 - white) + 255 * white);
    }
  }
  return shades;
}
