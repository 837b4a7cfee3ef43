/* Damped least squares on joint angles within their limits, and the inverse kinematics of a fingertip by it. */

const STEP = 1e-4; // rad, of the differences that give the derivatives
const MOST = 0.15; // rad that an angle turns in one iteration
const EASE = 0.02; // of its way to the middle of its range that an angle goes in one iteration, where the target allows it
const AFRESH = 40; // iterations from another start
const DAMPING = 8; // mm a rad, beside lever arms of some 50 mm
const SETTLED = 1e-5; // rad, of the largest turn after which no further iteration is made

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

function dot(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
  return sum;
}

/** The x of A x = b for a symmetric positive definite A, of which rows hold the lower triangle and are changed. */
function solve(rows, right) {
  const n = right.length, x = right.slice();
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) {
      let sum = rows[i][j];
      for (let k = 0; k < j; k++) sum -= rows[i][k] * rows[j][k];
      rows[i][j] = i === j ? Math.sqrt(sum) : sum / rows[j][j];
    }
    for (let k = 0; k < i; k++) x[i] -= rows[i][k] * x[k];
    x[i] /= rows[i][i];
  }
  for (let i = n - 1; i >= 0; i--) {
    x[i] /= rows[i][i];
    for (let k = 0; k < i; k++) x[k] -= rows[i][k] * x[i];
  }
  return x;
}

/** Turns angles (changed in place; those numbered by `which`) so that the residuals which `residuals()` gives at
    them shrink. Returns the last ones. `ease`: how far angles go to the middle of their ranges in an iteration. */
export function descend(residuals, angles, limits, which, iterations, ease) {
  let left = residuals();
  for (let n = 0; n < iterations; n++) {
    const columns = which.map((a) => {
      const before = angles[a];
      angles[a] += STEP;
      const there = residuals();
      angles[a] = before;
      return left.map((x, i) => (x - there[i]) / STEP);
    });
    const turned = step(angles, limits, which, columns, left, ease);
    left = residuals();
    if (turned < SETTLED) break;
  }
  return left;
}

/** Turns angles (changed in place) so that a point of a bone comes nearer to a target, as one sees it along `sight`
    (unit vector): its depth is free. Returns the distance left in mm. */
export function reach(hand, angles, limits, { bone, point, target, sight }, iterations) {
  const which = chain(hand, bone), motion = new Float64Array(12 * hand.bones);
  const here = () => carried(hand.motions(angles, motion), bone, point);
  const across = (x) => x.map((value, i) => value - dot(x, sight) * sight[i]);
  const left = (place) => across(target.map((x, i) => x - place[i]));
  return Math.hypot(...descend(() => left(here()), angles, limits, which, iterations, EASE));
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

/** One damped step; its largest turn in rad. Angles that it would take beyond a limit stay at it, and the others take
    it without them. An angle turns the more, the wider its range is: fingers bend before the palm does. */
function step(angles, limits, which, columns, error, easing) {
  const ranges = which.map((a) => limits[a][1] - limits[a][0]), widest = Math.max(...ranges);
  const stiffness = ranges.map((range) => (DAMPING * widest / range) ** 2);
  const ease = which.map((a) => easing * ((limits[a][0] + limits[a][1]) / 2 - angles[a])), began = [...angles];
  for (let free = which.map((_, i) => i).filter((i) => ranges[i] > 0); free.length;) {
    const rest = error.map((x, c) => x - free.reduce((s, i) => s + columns[i][c] * ease[i], 0));
    const rows = free.map((i, m) => free.slice(0, m + 1).map((j) => dot(columns[i], columns[j]) + (i === j ? stiffness[i] : 0)));
    const pull = solve(rows, free.map((i) => dot(columns[i], rest)));
    const turns = free.map((i, n) => ease[i] + pull[n]);
    const shorter = Math.min(1, MOST / Math.max(...turns.map(Math.abs)));
    const after = free.map((i, n) => angles[which[i]] + shorter * turns[n]);
    const clamped = free.map((i, n) => Math.min(Math.max(after[n], limits[which[i]][0]), limits[which[i]][1]));
    const within = free.every((_, n) => clamped[n] === after[n]);
    free.forEach((i, n) => { if (within || clamped[n] !== after[n]) angles[which[i]] = clamped[n]; });
    if (within) break;
    free = free.filter((_, n) => clamped[n] === after[n]);
  }
  return Math.max(0, ...which.map((a) => Math.abs(angles[a] - began[a])));
}
