/* Joint angles from a frame of landmarks, which may have any place and size: damped least squares within limits.

   As in handpipe.skeleton.drivers.landmark_motion, whose numbers it gets: the palm gives place and scale, and mainly the
   directions from landmark to landmark decide, since people's fingers differ in length from the hand's. */

import { carried, descend } from "reach";
import { breadth, similarity, spread } from "similarity";

const SETTLED = 1e-5; // rad, of the largest turn after which no further iteration is made
const FIRST = 80; // iterations in the first frame, from two starts
const NEXT = 20; // iterations in a frame after another

const minus = (a, b) => a.map((x, i) => x - b[i]);
const meanSquare = (values) => Math.sqrt(values.reduce((s, x) => s + x * x, 0) / Math.max(values.length, 1));
const unit = (a) => { const length = Math.hypot(...a); return a.map((x) => x / length); };

export class LandmarkFit {
  /** data: `places` (bone and neutral point by landmark), `segments` (pairs of landmarks), `palm` (weights), `by` (numbers
      and names of handpipe.skeleton.drivers.landmark_motion). */
  constructor(hand, limits, data) {
    Object.assign(this, { hand, limits, palm: Object.keys(data.palm), weights: Object.values(data.palm), segments: data.segments, by: data.by });
    this.places = Object.entries(data.places);
    this.which = limits.map((_, i) => i);
    this.motion = new Float64Array(12 * hand.bones);
  }

  /** Landmarks whose wrist tells the palm's direction alone: how far it is from the knuckles differs between trackers. */
  directed(points) {
    const { knuckles, arm } = this.by;
    if (!["WRIST", ...knuckles].every((name) => name in points)) return points;
    const row = knuckles.map((name) => points[name]), width = Math.hypot(...minus(row[0], row.at(-1)));
    const centre = [0, 1, 2].map((c) => row.reduce((s, p) => s + p[c], 0) / row.length);
    return { ...points, WRIST: unit(minus(points.WRIST, centre)).map((x, c) => centre[c] + arm * width * x) };
  }

  /** The hand's landmarks at angles, by name. */
  points(angles) {
    const motion = this.hand.motions(angles, this.motion);
    return this.directed(Object.fromEntries(this.places.map(([name, [bone, point]]) => [name, carried(motion, bone, point)])));
  }

  /** Landmarks as they are seen, placed on the hand's. */
  placed(seen, ours) {
    const fit = similarity(this.palm.map((n) => seen[n]), this.palm.map((n) => ours[n]), this.weights);
    return Object.fromEntries(this.places.map(([name]) => [name, fit(seen[name])]));
  }

  /** Of landmarks that were placed on the hand's palm. */
  residuals(placed, angles) {
    const ours = this.points(angles), found = [];
    for (const [a, b] of this.segments) {
      const theirs = unit(minus(placed[b], placed[a])), own = unit(minus(ours[b], ours[a]));
      for (let c = 0; c < 3; c++) found.push(this.by.lever * (theirs[c] - own[c]));
    }
    for (const [name] of this.places) for (let c = 0; c < 3; c++) found.push(this.by.lean * (placed[name][c] - ours[name][c]));
    for (const angle of angles) found.push(-this.by.rest * angle);
    return found;
  }

  /** Angles for landmarks (x, y, z by name), from those of the frame before or null; throws an `Error` if the palm
      is no palm. With root mean squares: `distance` in mm from the hand's landmarks, `turn` in rad of the bones. */
  fit(given, before) {
    const seen = this.directed(given);
    if (!(breadth(this.palm.map((n) => seen[n])) > this.by.narrow)) throw new Error("the palm's landmarks lie on a line and place no hand");
    const starts = before ? [before] : [this.limits.map(() => 0), this.limits.map(([a, b]) => (a + b) / 2)];
    const found = starts.map((start) => {
      const angles = Float64Array.from(start, (x, i) => Math.min(Math.max(x, this.limits[i][0]), this.limits[i][1]));
      return { angles, left: meanSquare(this.turned(seen, angles, before ? NEXT : FIRST)) };
    });
    return this.measured(seen, found.sort((a, b) => a.left - b.left)[0].angles);
  }

  /** Turns angles (changed in place) until they stay; the palm is placed anew in each iteration. Returns the residuals. */
  turned(seen, angles, iterations) {
    let left;
    for (let n = 0; n < iterations; n++) {
      const placed = this.placed(seen, this.points(angles)), from = [...angles];
      left = descend(() => this.residuals(placed, angles), angles, this.limits, this.which, 1, 0);
      if (from.every((x, i) => Math.abs(angles[i] - x) < SETTLED)) break;
    }
    return left;
  }

  measured(seen, angles) {
    const ours = this.points(angles), placed = this.placed(seen, ours);
    const apart = (name) => Math.hypot(...minus(placed[name], ours[name]));
    const palm = Math.sqrt(this.palm.reduce((s, n, i) => s + this.weights[i] * apart(n) ** 2, 0) / this.weights.reduce((a, b) => a + b, 0));
    if (!(palm <= this.by.palm_error * spread(this.palm.map((n) => ours[n]), this.weights))) {
      throw new Error(`the palm's landmarks are ${palm.toFixed(0)} mm off the hand's. Check that they are of a hand, in MediaPipe's order`);
    }
    const turns = this.segments.map(([a, b]) => {
      const chord = Math.hypot(...minus(unit(minus(placed[b], placed[a])), unit(minus(ours[b], ours[a]))));
      return 2 * Math.asin(Math.min(chord / 2, 1));
    });
    return { angles, distance: meanSquare(this.places.map(([name]) => apart(name))), turn: meanSquare(turns) };
  }
}
