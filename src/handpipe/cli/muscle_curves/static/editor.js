/* The content of a file of curves as a person changes it: every change is a new content; undo, redo; the server. */

const ATTACHMENT_REACH = 3; // mm, of a new attachment
const DIGITS = 1000; // per mm, of places in space
const round = (point) => point.map((x) => Math.round(x * DIGITS) / DIGITS);

/** Header and arrays of a message from the server. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true), start = 4 + length, arrays = {};
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  for (const [name, [kind, offset, count]] of Object.entries(header.arrays)) {
    arrays[name] = new (kind === "f4" ? Float32Array : Uint32Array)(buffer, start + offset, count);
  }
  return { ...header, arrays };
}

export async function post(name, body) {
  const response = await fetch(name, { method: "POST", body });
  if (!response.ok) throw new Error((await response.json()).said);
  return response;
}

export async function get(name) {
  const response = await fetch(name);
  if (!response.ok) throw new Error((await response.json()).said);
  return unpack(await response.arrayBuffer());
}

/** A content of which parts are changed: `change` gets a copy. */
export function changed(content, change) {
  const copy = structuredClone(content);
  change(copy);
  return copy;
}

/** The points of a curve or of an attachment: `at` is {muscle, kind: "curves" or "attachments", list, point}. */
export const pointsAt = (content, { muscle, kind, list }) => content.muscles[muscle]?.[kind]?.[list]?.points;

/** The fields of a point that are not its place. */
function values({ tissue, spread }) {
  return { ...(tissue === undefined ? {} : { tissue }), ...(spread === undefined ? {} : { spread }) };
}

export const inSpace = (point, at) => ({ at: round(at), ...values(point) });
export const onBone = (point, drop, bone) => ({ drop, ...(bone ? { bone } : {}), ...values(point) });

/** A new muscle or a new curve between two places on bones; its middle lies between them. */
export function newCurve(origin, insertion) {
  const middle = origin.point.map((x, i) => (x + insertion.point[i]) / 2);
  return { points: [onBone({}, origin.point, origin.bone), inSpace({}, middle), onBone({}, insertion.point, insertion.bone)] };
}

export const newAttachment = (end, place) => ({ end, reach: ATTACHMENT_REACH, points: [onBone({}, place.point, place.bone)] });

/** A normal that is far from the direction of a curve. */
export function anyNormal(places) {
  const along = places.at(-1).map((x, i) => Math.abs(x - places[0][i]));
  const least = along.indexOf(Math.min(...along));
  return [0, 1, 2].map((i) => (i === least ? 1 : 0));
}

/** Sends contents to the server, one at a time, the newest next; keeps what it accepted. */
export class Editor {
  /** `show` gets each answer with the time at which its content was asked for; `say` gets errors. */
  constructor(show, say) {
    Object.assign(this, { show, say, before: [], after: [], next: null, running: null });
  }

  start(state) { this.accept(state, performance.now()); }

  accept(state, asked) {
    this.content = state.content;
    if (!this.next) this.latest = state.content;
    this.show(state, asked);
  }

  /** Ask for a content; a step of undo unless it is a part of one. Resolves when nothing is left to send. */
  set(content, step = true) {
    if (step) this.mark();
    this.latest = content; // changes that come before the answer add to it
    this.next = { content, asked: performance.now() };
    this.running ??= this.run().finally(() => { this.running = null; });
    return this.running;
  }

  change(change, step = true) { return this.set(changed(this.latest, change), step); }

  /** The beginning of a step. */
  mark() {
    this.before.push(this.latest);
    this.after = [];
    this.saved = false;
  }

  async run() {
    while (this.next) {
      const { content, asked } = this.next;
      this.next = null;
      try {
        const response = await post("edit", JSON.stringify(content));
        this.accept(unpack(await response.arrayBuffer()), asked);
      } catch (error) {
        if (!this.next) this.latest = this.content;
        if (this.before.at(-1) === this.content) this.before.pop(); // nothing was changed that could be undone
        this.say(error.message);
      }
    }
  }

  async step(from, to) {
    await this.running;
    if (!from.length) return;
    to.push(this.content);
    await this.set(from.pop(), false);
    this.saved = false;
  }

  undo() { return this.step(this.before, this.after); }

  redo() { return this.step(this.after, this.before); }
}
