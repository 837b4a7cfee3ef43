/* Joint angles from a frame of landmarks, which may have any place and size: damped least squares within limits.

   As in handpipe.skeleton.drivers, the palm gives place and scale, and mainly the directions from landmark to landmark
   decide, since people's fingers differ in length from the hand's. Both follow the angles here. */

import { carried, descend } from "reach";
import { breadth, similarity, spread } from "similarity";

const LEAN = 0.3; // weight of a landmark's place, where the direction of its bone has one
const PALM_ERROR = 0.35; // distance of the palm's landmarks from the hand's, relative to their spread
const NARROW = 0.05; // second extent of the palm's landmarks over the first, below which they place no hand
const ARM = 1.5; // widths of the row of knuckles from them to the point that tells the palm's direction
const FIRST = 80; // iterations in the first frame, from two starts
const NEXT = 20; // iterations in a frame after another
const KNUCKLES = ["INDEX_FINGER", "MIDDLE_FINGER", "RING_FINGER", "PINKY"].map((finger) => `${finger}_MCP`);

const minus = (a, b) => a.map((x, i) => x - b[i]);
const meanSquare = (values) => Math.sqrt(values.reduce((s, x) => s + x * x, 0) / Math.max(values.length, 1));
const unit = (a) => { const length = Math.hypot(...a); return a.map((x) => x / length); };

export class LandmarkFit {
  /** data: `places` (bone and neutral point by landmark), `segments` (pairs of landmarks), `palm` (weights). */
  constructor(hand, limits, data) {
    Object.assign(this, { hand, limits, palm: Object.keys(data.palm), weights: Object.values(data.palm) });
    this.places = Object.entries(data.places);
    this.which = limits.map((_, i) => i);
    this.motion = new Float64Array(12 * hand.bones);
    const neutral = this.points(new Float64Array(limits.length));
    this.segments = data.segments.map(([a, b]) => [a, b, Math.hypot(...minus(neutral[b], neutral[a]))]);
  }

  /** The hand's landmarks at angles, by name. */
  points(angles) {
    const motion = this.hand.motions(angles, this.motion);
    return direct(Object.fromEntries(this.places.map(([name, [bone, point]]) => [name, carried(motion, bone, point)])));
  }

  /** Landmarks as they are seen, placed on the hand's. */
  placed(seen, ours) {
    const fit = similarity(this.palm.map((n) => seen[n]), this.palm.map((n) => ours[n]), this.weights);
    return Object.fromEntries(this.places.map(([name]) => [name, fit(seen[name])]));
  }

  residuals(seen, angles) {
    const ours = this.points(angles), placed = this.placed(seen, ours), found = [];
    for (const [a, b, length] of this.segments) {
      const theirs = unit(minus(placed[b], placed[a])), own = unit(minus(ours[b], ours[a]));
      for (let c = 0; c < 3; c++) found.push(length * (theirs[c] - own[c]));
    }
    for (const [name] of this.places) for (let c = 0; c < 3; c++) found.push(LEAN * (placed[name][c] - ours[name][c]));
    return found;
  }

  /** Angles for landmarks (x, y, z by name), from those of the frame before or null; throws an `Error` if the palm
      is no palm. With root mean squares: `distance` in mm from the hand's landmarks, `turn` in rad of the bones. */
  fit(given, before) {
    const seen = direct(given);
    if (!(breadth(this.palm.map((n) => seen[n])) > NARROW)) throw new Error("the palm's landmarks lie on a line and place no hand");
    const starts = before ? [before] : [this.limits.map(() => 0), this.limits.map(([a, b]) => (a + b) / 2)];
    const found = starts.map((start) => {
      const angles = Float64Array.from(start, (x, i) => Math.min(Math.max(x, this.limits[i][0]), this.limits[i][1]));
      const left = descend(() => this.residuals(seen, angles), angles, this.limits, this.which, before ? NEXT : FIRST, 0);
      return { angles, left: meanSquare(left) };
    });
    return this.measured(seen, found.sort((a, b) => a.left - b.left)[0].angles);
  }

  measured(seen, angles) {
    const ours = this.points(angles), placed = this.placed(seen, ours);
    const apart = (name) => Math.hypot(...minus(placed[name], ours[name]));
    const palm = Math.sqrt(this.palm.reduce((s, n, i) => s + this.weights[i] * apart(n) ** 2, 0) / this.weights.reduce((a, b) => a + b, 0));
    if (!(palm <= PALM_ERROR * spread(this.palm.map((n) => ours[n]), this.weights))) {
      throw new Error(`the palm's landmarks are ${palm.toFixed(0)} mm off the hand's. Check that they are of a hand, in MediaPipe's order`);
    }
    const turns = this.segments.map(([a, b]) => {
      const chord = Math.hypot(...minus(unit(minus(placed[b], placed[a])), unit(minus(ours[b], ours[a]))));
      return 2 * Math.asin(Math.min(chord / 2, 1));
    });
    return { angles, distance: meanSquare(this.places.map(([name]) => apart(name))), turn: meanSquare(turns) };
  }
}

/** Landmarks whose wrist tells the palm's direction alone: how far it is from the knuckles differs between trackers. */
function direct(points) {
  if (!["WRIST", ...KNUCKLES].every((name) => name in points)) return points;
  const row = KNUCKLES.map((name) => points[name]), width = Math.hypot(...minus(row[0], row[3]));
  const centre = [0, 1, 2].map((c) => row.reduce((s, p) => s + p[c], 0) / row.length);
  return { ...points, WRIST: unit(minus(points.WRIST, centre)).map((x, c) => centre[c] + ARM * width * x) };
}
