/* Inverse kinematics: damped least squares on the joints that carry a bone, within their limits. */

const STEP = 1e-4; // rad, of the differences that give the derivatives
const MOST = 0.15; // rad that an angle turns in one iteration
const EASE = 0.02; // of its way to the middle of its range that an angle goes in one iteration, where the target allows it
const AFRESH = 40; // iterations from another start
const DAMPING = 8; // mm a rad, beside lever arms of some 50 mm

/** Numbers of the angles on the way from a bone to the root. */
function chain(hand, bone) {
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

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** The x of A x = b for a symmetric positive definite A = [a b c; b d e; c e f]. */
function solve3([a, b, c, d, e, f], right) {
  const rows = [[d * f - e * e, c * e - b * f, b * e - c * d], [0, a * f - c * c, b * c - a * e], [0, 0, a * d - b * b]];
  [rows[1][0], rows[2][0], rows[2][1]] = [rows[0][1], rows[0][2], rows[1][2]];
  const det = dot([a, b, c], rows[0]);
  return rows.map((row) => dot(row, right) / det);
}

/** Turns angles (changed in place) so that a point of a bone comes nearer to a target, as one sees it along `sight`
    (unit vector): its depth is free. Returns the distance left in mm. */
export function reach(hand, angles, limits, { bone, point, target, sight }, iterations) {
  const which = chain(hand, bone), motion = new Float64Array(12 * hand.bones);
  const here = () => carried(hand.motions(angles, motion), bone, point);
  const across = (x) => x.map((value, i) => value - dot(x, sight) * sight[i]);
  const left = (place) => across(target.map((x, i) => x - place[i]));
  let place = here();
  for (let n = 0; n < iterations; n++) {
    const columns = which.map((a) => {
      const before = angles[a];
      angles[a] += STEP;
      const there = here();
      angles[a] = before;
      return across(there.map((x, i) => (x - place[i]) / STEP));
    });
    step(angles, limits, which, columns, left(place));
    place = here();
  }
  return Math.hypot(...left(place));
}

/** The same from the middle of the joints' ranges; kept if it comes nearer by a millimetre than the distance `left`. */
export function reachAfresh(hand, angles, limits, goal, left) {
  const other = angles.slice();
  for (const a of chain(hand, goal.bone)) other[a] = (limits[a][0] + limits[a][1]) / 2;
  const found = reach(hand, other, limits, goal, AFRESH);
  if (found > left - 1) return left;
  angles.set(other);
  return found;
}

/** One damped step. Angles that it would take beyond a limit stay at it, and the others take it without them.
    An angle turns the more, the wider its range is: fingers bend before the palm does. */
function step(angles, limits, which, columns, error) {
  const ranges = which.map((a) => limits[a][1] - limits[a][0]), widest = Math.max(...ranges);
  const shares = ranges.map((range) => (range / widest) ** 2);
  const ease = which.map((a) => EASE * ((limits[a][0] + limits[a][1]) / 2 - angles[a]));
  for (let free = which.map((_, i) => i); free.length;) {
    const sum = (p, q) => free.reduce((s, i) => s + shares[i] * columns[i][p] * columns[i][q], p === q ? DAMPING ** 2 : 0);
    const rest = error.map((x, c) => x - free.reduce((s, i) => s + columns[i][c] * ease[i], 0));
    const pull = solve3([sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)], rest);
    const turns = free.map((i) => ease[i] + shares[i] * dot(columns[i], pull));
    const shorter = Math.min(1, MOST / Math.max(...turns.map(Math.abs)));
    const after = free.map((i, n) => angles[which[i]] + shorter * turns[n]);
    const clamped = free.map((i, n) => Math.min(Math.max(after[n], limits[which[i]][0]), limits[which[i]][1]));
    const within = free.every((_, n) => clamped[n] === after[n]);
    free.forEach((i, n) => { if (within || clamped[n] !== after[n]) angles[which[i]] = clamped[n]; });
    if (within) return;
    free = free.filter((_, n) => clamped[n] === after[n]);
  }
}
