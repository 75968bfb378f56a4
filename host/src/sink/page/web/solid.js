// A detector as a solid on a screen: alone, or at its place on a body.

import { colourMaps } from "./colours.js";
import { normalsOf } from "./shapes.js";
import { MATT, shadesOf } from "./triangles.js";

const SHADES = { light: { darkest: 0.5, lift: -14 }, dark: { darkest: 0.4, lift: 34 } };

/** Canvas pixels of heat on solids, in a theme. */
export const heatShades = (theme) => shadesOf(colourMaps(theme).image, SHADES[theme]);

/** The triangles of a `shape`, as a camera sees them. */
export class Solid {
  /** `place` is where its frame is on a body, `{origin_m, axes}`; null where there is no body. */
  constructor(shape, place = null) {
    this.shape = shape;
    this.place = place;
    const count = shape.shares.length;
    this.points = place ? new Float32Array(3 * count) : shape.points;
    this.normals = new Float32Array(3 * count);
    /** @type {any} */
    this.screen = { share: shape.shares };
    for (const name of ["x", "y", "z", "light"]) this.screen[name] = new Float32Array(count);
    /** Its outline (m), where it has one. */
    this.rimsM = shape.rimsM.map((rim) => rim.map((corner) => this.at(corner)));
  }

  /** A place in the detector's frame (m), in that of the body. */
  at([x, y, z]) {
    if (!this.place) return [x, y, z];
    const { origin_m: origin, axes } = this.place;
    return origin.map((start, k) => start + x * axes[0][k] + y * axes[1][k] + z * axes[2][k]);
  }

  /** Draws it as it is when nothing presses, but what is drawn anew each time: of `scene`, which the camera looks at, a part or all. */
  drawRest(camera, scene, depth, shades) {
    const { shape } = this;
    shape.settle();
    this.#move();
    if (shape.raised !== shape.triangles) this.#draw(shape.triangles, camera, scene, depth, shades);
  }

  /** Draws what rises of it. */
  drawRaised(camera, scene, depth, shades) { this.#draw(this.shape.raised, camera, scene, depth, shades); }

  /** Moves its points to the heat of now. */
  update(field, scale) {
    this.shape.update(field, scale);
    this.#move();
  }

  // On a body its points are elsewhere than in its own frame.
  #move() {
    if (!this.place) return;
    const { points, shape: { points: own }, place: { origin_m: [ox, oy, oz], axes: [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] } } = this;
    for (let i = 0; i < own.length; i += 3) {
      const [x, y, z] = [own[i], own[i + 1], own[i + 2]];
      points[i] = ox + x * ax + y * bx + z * cx;
      points[i + 1] = oy + x * ay + y * by + z * cy;
      points[i + 2] = oz + x * az + y * bz + z * cz;
    }
  }

  #draw(triangles, camera, scene, depth, shades) {
    if (!triangles.length) return;
    const { points, normals, screen } = this;
    normalsOf(points, triangles, normals);
    camera.project(scene, points, screen, depth.width, depth.height);
    const [x, y, z] = camera.light();
    const [hx, hy, hz] = camera.shine();
    for (let i = 0, k = 0; i < screen.x.length; i += 1, k += 3) {
      const [nx, ny, nz] = [normals[k], normals[k + 1], normals[k + 2]];
      const facing = nx * x + ny * y + nz * z;
      const shining = Math.max(0, nx * hx + ny * hy + nz * hz) ** 24;
      screen.light[i] = MATT * (0.5 + 0.5 * facing) + (1 - MATT) * shining;
    }
    depth.draw(triangles, screen, shades);
  }

  /** Strokes its outline on `context`, in so many pieces an edge, where `shows(x, y, z)`; `at(...place)` projects. */
  drawRims(context, at, shows, pieces) {
    context.beginPath();
    for (const rim of this.rimsM) {
      rim.forEach((from, i) => {
        const to = rim[(i + 1) % rim.length];
        let before = null;
        for (let piece = 0; piece <= pieces; piece += 1) {
          const [x, y, z] = at(...from.map((v, k) => v + ((to[k] - v) * piece) / pieces));
          const now = { x, y, shows: shows(x, y, z) };
          if (before && (before.shows || now.shows)) {
            context.moveTo(before.x, before.y);
            context.lineTo(x, y);
          }
          before = now;
        }
      });
    }
    context.stroke();
  }
}
