// From values at the nodes of a mesh to values at the pixels of a grid. Which triangle a pixel lies in, and its weights there,
// never change: they are found once.

// Fine enough for the smallest contact: the screen smooths what is between.
const LONG_SIDE = 200;

/** A grid of pixels over the bounds of a mesh, upper row first. */
export class Raster {
  /** `nodesM`: positions (m); `triangles`: three nodes each; `bounds`: [[smallest x, y], [largest x, y]] (m). */
  constructor(nodesM, triangles, [[left, bottom], [right, top]]) {
    this.pixelM = Math.max(right - left, top - bottom) / LONG_SIDE;
    this.width = Math.max(2, Math.round((right - left) / this.pixelM));
    this.height = Math.max(2, Math.round((top - bottom) / this.pixelM));
    this.corners = new Int32Array(3 * this.width * this.height).fill(-1);
    this.weights = new Float32Array(3 * this.width * this.height);
    const pixels = nodesM.map(([x, y]) => [(x - left) / this.pixelM - 0.5, (top - y) / this.pixelM - 0.5]);
    for (const triangle of triangles) this.#cover(triangle, pixels);
    this.#spread();
  }

  #cover(triangle, pixels) {
    const [[ax, ay], [bx, by], [cx, cy]] = triangle.map((node) => pixels[node]);
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (area === 0) return;
    const rows = [Math.max(0, Math.ceil(Math.min(ay, by, cy))), Math.min(this.height - 1, Math.floor(Math.max(ay, by, cy)))];
    const columns = [Math.max(0, Math.ceil(Math.min(ax, bx, cx))), Math.min(this.width - 1, Math.floor(Math.max(ax, bx, cx)))];
    for (let y = rows[0]; y <= rows[1]; y += 1) {
      for (let x = columns[0]; x <= columns[1]; x += 1) {
        const b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area;
        const c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area;
        if (b < -1e-6 || c < -1e-6 || b + c > 1 + 1e-6) continue;
        const at = 3 * (y * this.width + x);
        this.corners.set(triangle, at);
        this.weights.set([1 - b - c, b, c], at);
      }
    }
  }

  // Gives the pixels just outside the mesh the values of a neighbour, so that smoothing leaves no pale rim.
  #spread() {
    const covered = this.corners.slice();
    for (let y = 0; y < this.height; y += 1) {
      for (let x = 0; x < this.width; x += 1) {
        const at = 3 * (y * this.width + x);
        if (covered[at] >= 0) continue;
        const near = this.#neighbours(x, y).find((other) => covered[other] >= 0);
        if (near === undefined) continue;
        this.corners.set(covered.subarray(near, near + 3), at);
        this.weights.set(this.weights.subarray(near, near + 3), at);
      }
    }
  }

  #neighbours(x, y) {
    return [[0, 1], [0, -1], [1, 0], [-1, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]]
      .map(([dx, dy]) => [x + dx, y + dy])
      .filter(([nx, ny]) => nx >= 0 && ny >= 0 && nx < this.width && ny < this.height)
      .map(([nx, ny]) => 3 * (ny * this.width + nx));
  }

  /** Fills `pixels` with the values at the nodes in between; pixels off the mesh become zero. */
  interpolate(values, pixels) {
    const { corners, weights } = this;
    for (let pixel = 0, at = 0; pixel < pixels.length; pixel += 1, at += 3) {
      pixels[pixel] = corners[at] < 0 ? 0 : weights[at] * values[corners[at]]
        + weights[at + 1] * values[corners[at + 1]] + weights[at + 2] * values[corners[at + 2]];
    }
  }
}
