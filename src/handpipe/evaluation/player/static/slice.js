/* A plane through the moving hand with the neutral image in it.

   A pixel within a bone goes back to neutral by the inverse of the bone's motion, which is exact. Any other one within the
   skin takes the nearest vertex of skin, organ or bone, and goes back with it by the inverse of the weighted mean of the
   bones' motions. This is a picture: it follows the surfaces, and between them the image goes with the nearest one. */

import * as THREE from "three";

const PIXEL = 1; // mm
const CELL = 3; // mm, of the cells in which vertices are looked for
const REACH = 15; // mm from a pixel, beyond which a vertex tells nothing of it
const LEAST = 0.05; // determinant of a mean of motions, below which it has collapsed

export class Slice {
  /** grid: shape, spacing and origin of the image's values; skin and bones: bodies with their first vertex, triangles
      and number of the bone; sphere: around the hand. */
  constructor(hand, grid, values, skin, bones, sphere) {
    Object.assign(this, { hand, grid, values, skin, bones, sphere });
    this.size = 2 * Math.ceil(sphere.radius / PIXEL);
    this.pixels = new Uint8Array(4 * this.size * this.size);
    this.texture = new THREE.DataTexture(this.pixels, this.size, this.size);
    Object.assign(this.texture, { colorSpace: THREE.SRGBColorSpace, magFilter: THREE.LinearFilter });
    const side = this.size * PIXEL;
    this.mesh = new THREE.Mesh(
      new THREE.PlaneGeometry(side, side),
      new THREE.MeshBasicMaterial({ map: this.texture, alphaTest: 0.5, side: THREE.DoubleSide }),
    );
    Object.assign(this.mesh, { visible: false, matrixAutoUpdate: false, frustumCulled: false });
    this.plane = new THREE.Plane(); // the hand is hidden before it
  }

  /** Turns the plane to a side of the hand (towards it, and upwards), at mm from the hand's middle. */
  place([x, y, z, ...up], offset) {
    const normal = new THREE.Vector3(x, y, z).normalize(), across = new THREE.Vector3(...up).cross(normal).normalize();
    const upward = normal.clone().cross(across), centre = this.sphere.center.clone().addScaledVector(normal, offset);
    this.frame = { normal: normal.toArray(), across: across.toArray(), up: upward.toArray(), centre: centre.toArray() };
    this.mesh.matrix.makeBasis(across, upward, normal).setPosition(centre);
    this.plane.setFromNormalAndCoplanarPoint(normal.negate(), centre);
  }

  /** Coordinates of a point in pixels across and upwards, and in mm before the plane. */
  local(array, i) {
    const { normal: n, across: a, up: u, centre: c } = this.frame;
    const x = array[i] - c[0], y = array[i + 1] - c[1], z = array[i + 2] - c[2], half = this.size / 2;
    return [(a[0] * x + a[1] * y + a[2] * z) / PIXEL + half, (u[0] * x + u[1] * y + u[2] * z) / PIXEL + half, n[0] * x + n[1] * y + n[2] * z];
  }

  /** Renews the picture from the hand's vertices, which all have to be computed. */
  renew() {
    const { pixels, size } = this, near = this.nearVertices();
    pixels.fill(0);
    const set = (i, j, neutral) => {
      const p = 4 * (j * size + i);
      if (pixels[p + 3]) return; // a bone is there
      pixels[p] = pixels[p + 1] = pixels[p + 2] = neutral ? this.grey(neutral) : 0;
      pixels[p + 3] = 255;
    };
    for (const bone of this.bones) this.fill(bone, (i, j) => set(i, j, this.before(bone.bone, this.point(i, j))));
    this.fill(this.skin, (i, j) => {
      const vertex = nearest(near, i + 0.5, j + 0.5);
      set(i, j, vertex < 0 ? null : this.neutral(vertex, this.point(i, j)));
    });
    this.texture.needsUpdate = true;
  }

  /** Does something with each pixel within a closed body. */
  fill(body, act) {
    this.rows(body).forEach((crossings, j) => {
      crossings.sort((a, b) => a - b);
      for (let k = 0; k + 1 < crossings.length; k += 2) {
        for (let i = Math.max(Math.ceil(crossings[k] - 0.5), 0); i < Math.min(crossings[k + 1] - 0.5, this.size); i++) act(i, j);
      }
    });
  }

  /** Where a body's triangles cross the middle of each row of pixels. */
  rows({ start, cells }) {
    const { vertices } = this.hand, rows = Array.from({ length: this.size }, () => []);
    for (let t = 0; t < cells.length; t += 3) {
      const corners = [0, 1, 2].map((k) => this.local(vertices, 3 * (start + cells[t + k])));
      const ends = [];
      for (let k = 0; k < 3; k++) {
        const a = corners[k], b = corners[(k + 1) % 3];
        if ((a[2] < 0) !== (b[2] < 0)) {
          const share = a[2] / (a[2] - b[2]);
          ends.push([a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]);
        }
      }
      if (ends.length < 2) continue;
      const [a, b] = ends[0][1] < ends[1][1] ? ends : [ends[1], ends[0]];
      for (let j = Math.max(Math.ceil(a[1] - 0.5), 0); j + 0.5 < b[1] && j < this.size; j++) {
        rows[j].push(a[0] + (j + 0.5 - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
      }
    }
    return rows;
  }

  /** Vertices near the plane, sorted into cells of it. */
  nearVertices() {
    const { vertices } = this.hand, reach = REACH / PIXEL, cell = CELL / PIXEL, wide = Math.ceil(this.size / cell);
    const found = [], at = [], counts = new Int32Array(wide * wide + 1);
    for (let v = 0; v < this.hand.count; v++) {
      const [x, y, z] = this.local(vertices, 3 * v), i = Math.floor(x / cell), j = Math.floor(y / cell);
      if (Math.abs(z / PIXEL) > reach || !(i >= 0 && j >= 0 && i < wide && j < wide)) continue;
      found.push(v, x, y, z / PIXEL);
      at.push(j * wide + i);
      counts[j * wide + i + 1]++;
    }
    for (let c = 0; c < wide * wide; c++) counts[c + 1] += counts[c];
    const next = counts.slice(), sorted = new Float64Array(found.length);
    at.forEach((c, n) => { sorted.set(found.slice(4 * n, 4 * n + 4), 4 * next[c]++); });
    return { sorted, starts: counts, wide, cell, reach };
  }

  /** Middle of a pixel. */
  point(i, j) {
    const { across: a, up: u, centre: c } = this.frame, half = this.size / 2;
    const x = (i + 0.5 - half) * PIXEL, y = (j + 0.5 - half) * PIXEL;
    return [0, 1, 2].map((k) => c[k] + x * a[k] + y * u[k]);
  }

  /** Where a point of a bone was in neutral. */
  before(bone, point) {
    const m = this.hand.motion, i = 12 * bone, [x, y, z] = [3, 7, 11].map((k, c) => point[c] - m[i + k]);
    return [0, 1, 2].map((c) => m[i + c] * x + m[i + 4 + c] * y + m[i + 8 + c] * z);
  }

  /** Where a point came from that moves with a vertex. */
  neutral(v, point) {
    const { rest, vertices, joints, weights, motion } = this.hand, m = new Float64Array(9);
    for (let k = 4 * v; k < 4 * v + 4; k++) {
      const i = 12 * joints[k], w = weights[k];
      if (w > 0) for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++) m[3 * r + c] += w * motion[i + 4 * r + c];
    }
    const [x, y, z] = [0, 1, 2].map((c) => point[c] - vertices[3 * v + c]);
    const p = m[4] * m[8] - m[5] * m[7], q = m[5] * m[6] - m[3] * m[8], r = m[3] * m[7] - m[4] * m[6];
    const det = Math.max(m[0] * p + m[1] * q + m[2] * r, LEAST);
    return [
      rest[3 * v] + (p * x + (m[2] * m[7] - m[1] * m[8]) * y + (m[1] * m[5] - m[2] * m[4]) * z) / det,
      rest[3 * v + 1] + (q * x + (m[0] * m[8] - m[2] * m[6]) * y + (m[2] * m[3] - m[0] * m[5]) * z) / det,
      rest[3 * v + 2] + (r * x + (m[1] * m[6] - m[0] * m[7]) * y + (m[0] * m[4] - m[1] * m[3]) * z) / det,
    ];
  }

  /** The image at a neutral point, between eight voxels; 0 beyond. */
  grey(point) {
    const { shape, spacing, origin } = this.grid, at = point.map((x, c) => (x - origin[c]) / spacing);
    if (at.some((x, c) => !(x >= 0 && x <= shape[c] - 1))) return 0;
    const low = at.map((x, c) => Math.min(Math.floor(x), Math.max(shape[c] - 2, 0))), part = at.map((x, c) => x - low[c]);
    let sum = 0;
    for (let n = 0; n < 8; n++) {
      const step = [n & 1, (n >> 1) & 1, n >> 2];
      const weight = step.reduce((w, s, c) => w * (s ? part[c] : 1 - part[c]), 1);
      const [i, j, k] = step.map((s, c) => low[c] + s);
      if (weight > 0) sum += weight * this.values[(i * shape[1] + j) * shape[2] + k];
    }
    return Math.round(sum);
  }
}

/** Number of the vertex nearest to a point of the plane, -1 if none is in reach; rings of cells, the nearest first. */
function nearest({ sorted, starts, wide, cell, reach }, x, y) {
  const ci = Math.floor(x / cell), cj = Math.floor(y / cell);
  let best = reach * reach, found = -1;
  for (let ring = 0; ring <= Math.ceil(reach / cell); ring++) {
    if (ring > 1 && ((ring - 1) * cell) ** 2 > best) break;
    for (let j = Math.max(cj - ring, 0); j <= Math.min(cj + ring, wide - 1); j++) {
      const step = Math.abs(j - cj) === ring ? 1 : 2 * ring;
      for (let i = ci - ring; i <= ci + ring; i += Math.max(step, 1)) {
        if (i < 0 || i >= wide) continue;
        for (let n = starts[j * wide + i]; n < starts[j * wide + i + 1]; n++) {
          const squared = (sorted[4 * n + 1] - x) ** 2 + (sorted[4 * n + 2] - y) ** 2 + sorted[4 * n + 3] ** 2;
          if (squared < best) { best = squared; found = sorted[4 * n]; }
        }
      }
    }
  }
  return found;
}
