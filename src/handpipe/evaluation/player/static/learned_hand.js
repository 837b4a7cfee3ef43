/* A learned hand: joint angles to motions of bones and to vertices, as handpipe.levels.LearnedHand has them. */

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const TYPES = { Float32Array, Float64Array, Int16Array, Int32Array, Uint8Array };
const STILL = 0.01; // rad, half the least range of an angle

/** Arrays by name from compressed base64 text and its index. */
export async function unpack(index, text) {
  const stream = new Blob([bytes(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  return Object.fromEntries(
    Object.entries(index).map(([name, [type, first, count]]) => [name, new TYPES[type](buffer, first, count)]),
  );
}

/** Rotation (9 numbers, row by row) of a rotation vector in rad. */
function rotation(x, y, z, out) {
  const angle = Math.sqrt(x * x + y * y + z * z), small = angle < 1e-8;
  const a = small ? 1 : Math.sin(angle) / angle, b = small ? 0.5 : (1 - Math.cos(angle)) / (angle * angle);
  out[0] = 1 - b * (y * y + z * z); out[1] = b * x * y - a * z; out[2] = b * x * z + a * y;
  out[3] = b * x * y + a * z; out[4] = 1 - b * (x * x + z * z); out[5] = b * y * z - a * x;
  out[6] = b * x * z - a * y; out[7] = b * y * z + a * x; out[8] = 1 - b * (x * x + y * y);
}

function product(a, b, out) {
  for (let r = 0; r < 9; r += 3) {
    const x = a[r], y = a[r + 1], z = a[r + 2]; // out may be a
    for (let c = 0; c < 3; c++) out[r + c] = x * b[c] + y * b[3 + c] + z * b[6 + c];
  }
}

const row = (m, r, x, y, z) => m[r] * x + m[r + 1] * y + m[r + 2] * z;

export class LearnedHand {
  constructor(arrays) {
    Object.assign(this, arrays);
    this.count = this.rest.length / 3;
    this.bones = this.skeleton_parents.length + 1;
    this.scaled = new Float64Array(this.lower.length);
    this.amounts = new Float64Array(this.steps.length); // of the shapes, in which their steps are
    this.starts = new Int32Array(this.parts.length); // by row: its first integer
    for (let r = 1; r < this.parts.length; r++) this.starts[r] = this.starts[r - 1] + 3 * this.shapesOf(this.parts[r - 1]);
    this.points = new Float32Array(this.rest); // neutral points with correctives
    this.vertices = new Float32Array(this.rest);
    this.motion = new Float64Array(12 * this.bones);
    this.duals = new Float64Array(8 * this.bones);
    this.scratch = { turn: new Float64Array(9), small: new Float64Array(9), single: new Float64Array(9) };
  }

  shapesOf(part) { return this.drivers_ends[part + 1] - this.drivers_ends[part]; }

  /** Motions (12 numbers a bone: rows of rotation and translation) at angles in rad, into out. */
  motions(angles, out = this.motion) {
    const { turn, small, single } = this.scratch, joints = this.skeleton_parents.length;
    out.fill(0, 0, 12);
    out[0] = out[5] = out[10] = 1;
    for (let j = 0; j < joints; j++) {
      const dofs = this.skeleton_dofs[j], first = this.skeleton_first[j], c = this.skeleton_centres, o = this.skeleton_offsets;
      turn.fill(0);
      turn[0] = turn[4] = turn[8] = 1;
      let ax = 0, ay = 0, az = 0; // what the offset of the second axis adds
      for (let k = 0; k < dofs; k++) {
        const i = this.skeleton_order[3 * j + k], t = angles[first + i], at = 9 * j + 3 * i, axes = this.skeleton_axes;
        rotation(t * axes[at], t * axes[at + 1], t * axes[at + 2], single);
        if (dofs === 2 && k === 1) {
          const x = o[3 * j], y = o[3 * j + 1], z = o[3 * j + 2];
          const u = x - row(single, 0, x, y, z), v = y - row(single, 3, x, y, z), w = z - row(single, 6, x, y, z);
          ax = row(turn, 0, u, v, w); ay = row(turn, 3, u, v, w); az = row(turn, 6, u, v, w);
        }
        product(turn, single, turn);
      }
      const [sx, sy, sz] = this.residual(j, angles, small);
      const x = c[3 * j], y = c[3 * j + 1], z = c[3 * j + 2];
      const u = ax - row(turn, 0, x, y, z), v = ay - row(turn, 3, x, y, z), w = az - row(turn, 6, x, y, z);
      const px = row(small, 0, u, v, w) + x + sx, py = row(small, 3, u, v, w) + y + sy, pz = row(small, 6, u, v, w) + z + sz;
      product(small, turn, small);
      const above = 12 * this.skeleton_parents[j], own = 12 * (j + 1);
      for (let r = 0; r < 12; r += 4) {
        const a = out[above + r], b = out[above + r + 1], d = out[above + r + 2];
        for (let k = 0; k < 3; k++) out[own + r + k] = a * small[k] + b * small[3 + k] + d * small[6 + k];
        out[own + r + 3] = a * px + b * py + d * pz + out[above + r + 3];
      }
    }
    return out;
  }

  /** A joint's residual rotation into `turn`, its residual translation in mm as the result. */
  residual(j, angles, turn) {
    const dofs = this.skeleton_dofs[j], t = angles.slice(this.skeleton_first[j], this.skeleton_first[j] + dofs);
    const clamped = t.map((v, i) => Math.min(Math.max(v, this.skeleton_lower[3 * j + i]), this.skeleton_upper[3 * j + i]));
    const squares = t.map((v, i) => clamped[i] * (2 * v - clamped[i]));
    const terms = dofs === 2 ? [...t, squares[0], t[0] * t[1], squares[1]] : [...t, ...squares];
    if (dofs === 3) terms.push(t[0] * t[1], t[0] * t[2], t[1] * t[2]);
    const vector = [0, 0, 0], shift = [0, 0, 0];
    terms.forEach((term, i) => {
      for (let c = 0; c < 3; c++) {
        vector[c] += term * this.skeleton_turns[27 * j + 3 * i + c];
        shift[c] += term * this.skeleton_shifts[27 * j + 3 * i + c];
      }
    });
    rotation(...vector, turn);
    return shift;
  }

  /** Angles with the learned range at -1 to 1, as parts of the hand are driven by them. */
  scale(angles) {
    for (let i = 0; i < this.scaled.length; i++) {
      const width = this.upper[i] - this.lower[i];
      this.scaled[i] = width > 0 ? (2 * angles[i] - this.lower[i] - this.upper[i]) / width : 0;
    }
  }

  /** Amounts of all shapes at scaled angles. */
  drive() {
    const { drivers_at: at, drivers_of_part: which, drivers_known: known, drivers_ends: ends } = this;
    for (let p = 0; p < ends.length - 1; p++) {
      const dofs = at[p + 1] - at[p], shapes = this.shapesOf(p), found = new Float64Array(shapes);
      const count = shapes ? (this.drivers_gains_at[p + 1] - this.drivers_gains_at[p]) / shapes : 0;
      const degree = this.drivers_kinds[2 * p], breadth = this.drivers_kinds[2 * p + 1];
      for (let f = 0; f < count; f++) {
        let dot = 0, squared = 0;
        for (let i = 0; i < dofs; i++) {
          const a = this.scaled[which[at[p] + i]], b = known[this.drivers_known_at[p] + f * dofs + i];
          dot += a * b;
          squared += (a - b) * (a - b);
        }
        const linear = 1 + dot / Math.max(dofs, 1), gain = this.drivers_gains_at[p] + f * shapes;
        const value = degree > 0 ? linear ** degree : linear + Math.exp(-squared / (2 * breadth * breadth));
        for (let k = 0; k < shapes; k++) found[k] += value * this.drivers_gains[gain + k];
      }
      for (let k = 0; k < shapes; k++) this.amounts[ends[p] + k] = found[k] * this.steps[ends[p] + k];
    }
  }

  /** Moves the hand to angles in rad at a level; `vertices` has the result for ranges [start, end) of vertices. */
  pose(angles, level, ranges = [[0, this.count]]) {
    this.motions(angles);
    this.scale(angles);
    if (level === "L1") this.drive();
    else this.dualQuaternions();
    for (const [start, end] of ranges) {
      if (level === "L1") this.correct(start, end);
      this.skin(level === "L1" ? this.points : this.rest, start, end);
      if (level === "L0") this.skinDual(start, end);
    }
    return this.vertices;
  }

  /** Neutral points with what the parts add; each row of a vertex has x, y, z of every shape of its part. */
  correct(start, end) {
    const { rest, rows, parts, starts, basis, amounts, points, drivers_ends: ends } = this;
    for (let v = start; v < end; v++) {
      let x = rest[3 * v], y = rest[3 * v + 1], z = rest[3 * v + 2];
      for (let r = rows[v]; r < rows[v + 1]; r++) {
        const last = ends[parts[r] + 1];
        for (let k = ends[parts[r]], i = starts[r]; k < last; k++, i += 3) {
          const amount = amounts[k];
          x += amount * basis[i];
          y += amount * basis[i + 1];
          z += amount * basis[i + 2];
        }
      }
      points[3 * v] = x;
      points[3 * v + 1] = y;
      points[3 * v + 2] = z;
    }
  }

  /** Weighted means of four bones' motions. */
  skin(points, start, end) {
    const { joints, weights, motion: m, vertices } = this;
    for (let v = start; v < end; v++) {
      const x = points[3 * v], y = points[3 * v + 1], z = points[3 * v + 2];
      let a = 0, b = 0, c = 0;
      for (let k = 4 * v; k < 4 * v + 4; k++) {
        const w = weights[k];
        if (w <= 0) continue;
        const i = 12 * joints[k];
        a += w * (m[i] * x + m[i + 1] * y + m[i + 2] * z + m[i + 3]);
        b += w * (m[i + 4] * x + m[i + 5] * y + m[i + 6] * z + m[i + 7]);
        c += w * (m[i + 8] * x + m[i + 9] * y + m[i + 10] * z + m[i + 11]);
      }
      vertices[3 * v] = a;
      vertices[3 * v + 1] = b;
      vertices[3 * v + 2] = c;
    }
  }

  /** Real and dual parts, each as w, x, y, z, of the bones' motions. */
  dualQuaternions() {
    for (let i = 0; i < this.bones; i++) {
      const m = (r, c) => this.motion[12 * i + 4 * r + c], q = [0, 0, 0, 0], trace = m(0, 0) + m(1, 1) + m(2, 2);
      let l = 0;
      for (let k = 1; k < 3; k++) if (m(k, k) > m(l, l)) l = k;
      const j = (l + 1) % 3, k = (l + 2) % 3;
      if (trace > m(l, l)) q.splice(0, 4, 1 + trace, m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
      else {
        q[0] = m(k, j) - m(j, k);
        q[1 + l] = 1 + m(l, l) - m(j, j) - m(k, k);
        q[1 + j] = m(j, l) + m(l, j);
        q[1 + k] = m(k, l) + m(l, k);
      }
      const norm = Math.hypot(...q), [w, x, y, z] = q.map((value) => value / norm), [a, b, c] = [m(0, 3), m(1, 3), m(2, 3)];
      this.duals.set([
        w, x, y, z, -(a * x + b * y + c * z) / 2, (a * w + b * z - c * y) / 2, (b * w + c * x - a * z) / 2, (c * w + a * y - b * x) / 2,
      ], 8 * i);
    }
  }

  /** Of vertices marked for it: blends of dual quaternions (Kavan 2008), on the side of the first bone's. */
  skinDual(start, end) {
    const { joints, weights, duals: d, rest, vertices } = this, q = new Float64Array(8);
    for (let v = start; v < end; v++) {
      if (!this.dual[v]) continue;
      const first = 8 * joints[4 * v];
      q.fill(0);
      for (let k = 4 * v; k < 4 * v + 4; k++) {
        const i = 8 * joints[k], side = d[first] * d[i] + d[first + 1] * d[i + 1] + d[first + 2] * d[i + 2] + d[first + 3] * d[i + 3];
        const weight = side < 0 ? -weights[k] : weights[k];
        if (weight !== 0) for (let n = 0; n < 8; n++) q[n] += weight * d[i + n];
      }
      const [w, x, y, z, e, f, g, h] = q, norm = w * w + x * x + y * y + z * z;
      const a = rest[3 * v], b = rest[3 * v + 1], c = rest[3 * v + 2];
      const i = w * a + y * c - z * b, j = w * b + z * a - x * c, k = w * c + x * b - y * a;
      vertices[3 * v] = a + 2 * (y * k - z * j + w * f - e * x + y * h - z * g) / norm;
      vertices[3 * v + 1] = b + 2 * (z * i - x * k + w * g - e * y + z * f - x * h) / norm;
      vertices[3 * v + 2] = c + 2 * (x * j - y * i + w * h - e * z + x * g - y * f) / norm;
    }
  }

  /** How far angles are from the learned poses: above 1, the stated errors do not hold. */
  distance(angles) {
    this.scale(angles);
    const { drivers_at: at, drivers_known: known, drivers_known_at: begin } = this, [farthest, gap] = this.alarm_scales;
    let most = 0;
    for (let p = 0; p < this.alarm_typical.length; p++) {
      const dofs = at[p + 1] - at[p];
      let least = dofs ? Infinity : 0;
      for (let f = begin[p]; f < begin[p + 1]; f += Math.max(dofs, 1)) {
        let squared = 0;
        for (let i = 0; i < dofs; i++) squared += (this.scaled[this.drivers_of_part[at[p] + i]] - known[f + i]) ** 2;
        least = Math.min(least, squared);
      }
      most = Math.max(most, Math.sqrt(least / Math.max(dofs, 1)) / this.alarm_typical[p] / farthest);
    }
    for (let i = 0; i < angles.length; i++) {
      const half = Math.max((this.alarm_upper[i] - this.alarm_lower[i]) / 2, STILL);
      most = Math.max(most, Math.max(this.alarm_lower[i] - angles[i], angles[i] - this.alarm_upper[i]) / half / gap);
    }
    return most;
  }
}

/** Normals of the vertices in [start, end): sums of the triangles' ones, weighted by area. */
export function normals(vertices, cells, start, end, out) {
  out.fill(0, 3 * start, 3 * end);
  for (let t = 0; t < cells.length; t += 3) {
    const i = 3 * (start + cells[t]), j = 3 * (start + cells[t + 1]), k = 3 * (start + cells[t + 2]);
    const ux = vertices[j] - vertices[i], uy = vertices[j + 1] - vertices[i + 1], uz = vertices[j + 2] - vertices[i + 2];
    const vx = vertices[k] - vertices[i], vy = vertices[k + 1] - vertices[i + 1], vz = vertices[k + 2] - vertices[i + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    out[i] += x; out[i + 1] += y; out[i + 2] += z;
    out[j] += x; out[j + 1] += y; out[j + 2] += z;
    out[k] += x; out[k + 1] += y; out[k + 2] += z;
  }
}
