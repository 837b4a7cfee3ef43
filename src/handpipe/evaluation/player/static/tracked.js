/* A file of landmarks that is opened or dropped on the page: its frames' angles, residuals and motion. */

import { LandmarkFit } from "landmark-fit";
import { readLandmarks } from "landmark-file";

const RATE = 24; // frames a second, as exports show frames
const TURN = 30; // ms of fitting after which the page gets its turn
const DEGREE = Math.PI / 180;

const meanSquare = (values) => Math.sqrt(values.reduce((s, x) => s + x * x, 0) / values.length);
const later = () => new Promise((done) => { setTimeout(done); });

export class Tracked {
  constructor(player, data) {
    Object.assign(this, { player, data, found: [], opened: 0 });
    this.fit = new LandmarkFit(player.hand, player.limits, data);
    this.said = player.find(".said");
    this.file = player.find(".file");
    this.frame = player.find(".frame");
    this.button = player.find(".tracked");
    this.listen();
  }

  listen() {
    this.player.find(".open").addEventListener("click", () => this.file.click());
    this.file.addEventListener("change", () => { if (this.file.files.length) this.open(this.file.files[0]); });
    this.frame.addEventListener("input", () => { this.player.stop(); this.show(this.frame.value - 1); });
    this.button.addEventListener("click", () => (this.playing() ? this.player.stop() : this.play()));
    this.player.root.addEventListener("dragover", (e) => e.preventDefault());
    this.player.root.addEventListener("drop", (e) => {
      e.preventDefault();
      if (e.dataTransfer.files.length) this.open(e.dataTransfer.files[0]);
    });
  }

  /** Reads and fits a file, and plays it; words of what is wrong with it instead. A later file ends an earlier one. */
  async open(file) {
    const own = ++this.opened;
    this.player.stop();
    this.take([]);
    this.tell(`${file.name}: reading`);
    try {
      const found = await this.fitted(file.name, await file.text(), () => own !== this.opened);
      if (own !== this.opened) return;
      this.take(found);
      const distance = meanSquare(found.map((f) => f.distance)), turn = meanSquare(found.map((f) => f.turn)) / DEGREE;
      this.tell(`${file.name}: ${found.length} ${found.length === 1 ? "frame" : "frames"}. Root mean squares: landmarks ${distance.toFixed(1)} mm from the hand's, bones' directions ${turn.toFixed(1)}°.`);
      this.play();
    } catch (error) {
      if (own === this.opened) this.tell(error.message, true);
    }
    this.file.value = ""; // the same file can be opened again
  }

  /** Angles and residuals of a file's frames. */
  async fitted(name, text, ended) {
    const { frames, hand } = readLandmarks(name, text, this.data.names), found = [];
    const side = hand !== null && hand !== this.data.hand ? -1 : 1; // landmarks of the other hand are mirrored
    let turn = performance.now();
    for (const frame of frames) {
      if (ended()) break;
      const points = Object.fromEntries(Object.entries(frame.points).map(([landmark, [x, y, z]]) => [landmark, [side * x, y, z]]));
      try {
        found.push({ name: frame.name, ...this.fit.fit(points, found.at(-1)?.angles ?? null) });
      } catch (error) {
        throw new Error(`${name}: frame ${frame.name}: ${error.message}.`);
      }
      if (performance.now() - turn < TURN) continue;
      this.tell(`${name}: frame ${found.length} of ${frames.length} is fitted`);
      await later();
      turn = performance.now();
    }
    return found;
  }

  take(found) {
    this.found = found;
    this.frame.max = Math.max(found.length, 1);
    this.frame.disabled = this.button.disabled = found.length === 0;
    this.point(0);
  }

  tell(words, wrong = false) {
    this.said.textContent = words;
    this.said.classList.toggle("on", wrong);
  }

  /** The slider at a frame, with the frame's residual. */
  point(number) {
    const frame = this.found[number];
    this.frame.value = number + 1;
    this.frame.previousElementSibling.textContent = frame ? `frame ${frame.name.replace(/^frame/, "")}` : "frame";
    this.frame.nextElementSibling.textContent = frame ? `${frame.distance.toFixed(1)} mm` : "";
  }

  show(number) {
    this.point(number);
    this.player.set(this.found[number].angles);
  }

  playing() { return this.player.playing?.button === this.button; }

  play() {
    const reached = (number) => this.point(number);
    this.player.play(this.button, this.found.map(({ angles }) => angles), { seconds: 1 / RATE, share: (t) => t, reached });
  }
}
