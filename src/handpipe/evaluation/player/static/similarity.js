/* Points moved, turned and scaled onto others (Horn 1987). */

const SWEEPS = 30; // of Jacobi's method, which needs some six

/** Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations. */
function eigen(matrix) {
  const n = matrix.length, a = matrix.map((row) => [...row]);
  const vectors = a.map((_, i) => a.map((__, j) => (i === j ? 1 : 0)));
  for (let sweep = 0; sweep < SWEEPS; sweep++) {
    let off = 0;
    for (let p = 0; p < n; p++) {
      for (let q = p + 1; q < n; q++) {
        if (a[p][q] === 0) continue;
        off = Math.max(off, Math.abs(a[p][q]) / Math.max(Math.abs(a[p][p]), Math.abs(a[q][q]), Number.MIN_VALUE));
        const ratio = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const t = (ratio < 0 ? -1 : 1) / (Math.abs(ratio) + Math.hypot(ratio, 1)), c = 1 / Math.hypot(t, 1), s = t * c;
        for (let k = 0; k < n; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
        for (let k = 0; k < n; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        for (let k = 0; k < n; k++) {
          const [x, y] = [vectors[k][p], vectors[k][q]];
          [vectors[k][p], vectors[k][q]] = [c * x - s * y, s * x + c * y];
        }
      }
    }
    if (off < 1e-16) break;
  }
  return { values: a.map((row, i) => row[i]), vectors };
}

function middle(points, weights) {
  const total = weights.reduce((a, b) => a + b, 0);
  return [0, 1, 2].map((c) => points.reduce((s, p, i) => s + weights[i] * p[c], 0) / total);
}

const away = (points, from) => points.map((p) => p.map((x, c) => x - from[c]));

/** Sums of products (3, 3) of the coordinates of two sets of points. */
const products = (a, b, weights) => [0, 1, 2].map((i) => [0, 1, 2].map((j) => a.reduce((s, p, n) => s + weights[n] * p[i] * b[n][j], 0)));

/** Root of the weighted mean square distance of points from their middle. */
export function spread(points, weights) {
  const squares = away(points, middle(points, weights)).map((p) => p.reduce((s, x) => s + x * x, 0));
  return Math.sqrt(squares.reduce((s, x, i) => s + weights[i] * x, 0) / weights.reduce((a, b) => a + b, 0));
}

/** Second extent of points over their first: 0 on a line. */
export function breadth(points) {
  const even = points.map(() => 1), centred = away(points, middle(points, even));
  const [first, second] = eigen(products(centred, centred, even)).values.sort((a, b) => b - a);
  return first > 0 ? Math.sqrt(Math.max(second, 0) / first) : 0;
}

/** The motion, as a function of a point, that brings points nearest to others after their spread was made equal. */
export function similarity(points, others, weights) {
  const from = middle(points, weights), to = middle(others, weights), scale = spread(others, weights) / spread(points, weights);
  const [[a, b, c], [d, e, f], [g, h, i]] = products(away(points, from), away(others, to), weights);
  const { values, vectors } = eigen([
    [a + e + i, f - h, g - c, b - d],
    [f - h, a - e - i, b + d, g + c],
    [g - c, b + d, e - a - i, f + h],
    [b - d, g + c, f + h, i - a - e],
  ]);
  const [w, x, y, z] = vectors.map((row) => row[values.indexOf(Math.max(...values))]);
  const turn = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
  return (p) => turn.map((r, k) => to[k] + scale * (r[0] * (p[0] - from[0]) + r[1] * (p[1] - from[1]) + r[2] * (p[2] - from[2])));
}
