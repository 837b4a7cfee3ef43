/* Inverse kinematics: damped least squares on the joints that carry a bone, within their limits. */

const STEP = 1e-4; // rad, of the differences that give the derivatives
const MOST = 0.15; // rad that an angle turns in one iteration
const DAMPING = 8; // mm a rad, beside lever arms of some 50 mm

/** Numbers of the angles on the way from a bone to the root. */
export function chain(hand, bone) {
  const found = [];
  for (let b = bone; b > 0; b = hand.skeleton_parents[b - 1]) {
    for (let i = 0; i < hand.skeleton_dofs[b - 1]; i++) found.push(hand.skeleton_first[b - 1] + i);
  }
  return found;
}

/** Where motions take a point of a bone. */
export function carried(motion, bone, [x, y, z]) {
  const i = 12 * bone;
  return [0, 4, 8].map((r) => motion[i + r] * x + motion[i + r + 1] * y + motion[i + r + 2] * z + motion[i + r + 3]);
}

/** The x of A x = b for a symmetric positive definite A (3, 3). */
function solve3([a, b, c, d, e, f], [x, y, z]) { // A: a b c / b d e / c e f
  const A = d * f - e * e, B = c * e - b * f, C = b * e - c * d, det = a * A + b * B + c * C;
  const D = a * f - c * c, E = b * c - a * e, F = a * d - b * b;
  return [(A * x + B * y + C * z) / det, (B * x + D * y + E * z) / det, (C * x + E * y + F * z) / det];
}

/** Turns angles (changed in place) so that a point of a bone comes nearer to a target; the distance left in mm. */
export function reach(hand, angles, limits, bone, point, target, iterations) {
  const which = chain(hand, bone), motion = new Float64Array(12 * hand.bones), shifted = new Float64Array(12 * hand.bones);
  const left = () => carried(hand.motions(angles, motion), bone, point).map((x, i) => target[i] - x);
  let error = left();
  for (let n = 0; n < iterations; n++) {
    const here = target.map((x, i) => x - error[i]);
    const columns = which.map((a) => {
      const before = angles[a];
      angles[a] += STEP;
      const there = carried(hand.motions(angles, shifted), bone, point);
      angles[a] = before;
      return there.map((x, i) => (x - here[i]) / STEP);
    });
    step(angles, limits, which, columns, error);
    error = left();
  }
  return Math.hypot(...error);
}

/** One damped step; angles that it would take beyond a limit stay there, and the others take it without them. */
function step(angles, limits, which, columns, error) {
  let free = which.map((_, i) => i);
  for (;;) {
    const sum = (p, q) => free.reduce((s, i) => s + columns[i][p] * columns[i][q], p === q ? DAMPING ** 2 : 0);
    const pull = solve3([sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)], error);
    const turns = free.map((i) => columns[i].reduce((s, x, c) => s + x * pull[c], 0));
    const shorter = Math.min(1, MOST / Math.max(...turns.map(Math.abs), 1e-12));
    const after = turns.map((turn, n) => angles[which[free[n]]] + shorter * turn);
    const within = after.map((value, n) => value >= limits[which[free[n]]][0] && value <= limits[which[free[n]]][1]);
    const stuck = free.filter((_, n) => !within[n]);
    if (stuck.length === 0) {
      free.forEach((i, n) => { angles[which[i]] = after[n]; });
      return;
    }
    stuck.forEach((i) => {
      const [low, high] = limits[which[i]];
      angles[which[i]] = after[free.indexOf(i)] < low ? low : high;
    });
    const atLimit = new Set(stuck);
    free = free.filter((i) => !atLimit.has(i));
    if (free.length === 0) return;
  }
}
