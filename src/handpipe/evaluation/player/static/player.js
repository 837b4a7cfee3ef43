/* A page that moves a learned hand: sliders, fingertips to drag, layers to switch, errors and alarm in words. */

import * as THREE from "three";
import { LearnedHand, normals, unpack } from "learned-hand";
import { carried, reach, reachAfresh } from "reach";
import { Slice } from "slice";
import { Space, looks, meshesOf } from "space";
import { Tracked } from "tracked";

const TIP = 2.5; // mm, radius of a point that is dragged
const NEAR = 18; // pixels from such a point at which a pointer takes it
const ITERATIONS = 4; // of the inverse kinematics a frame
const CLOSE = 0.2; // mm from the pointer at which it ends
const FRAMES = 30; // after the pointer's last motion, after which it ends
const AFRESH = 20; // such frames left, at which it tries another start: a stretched finger bends to either side
const SECONDS = 1.5; // from pose to pose of the motion
const KEPT = 60; // frames over which costs are averaged
const DEGREE = Math.PI / 180;

const mean = (values) => values.reduce((a, b) => a + b, 0) / Math.max(values.length, 1);

/** A body: bones are moved by a matrix, soft ones are ranges of the hand's arrays. */
class Body {
  constructor(data, number, hand, arrays) {
    Object.assign(this, data);
    this.hand = hand;
    this.cells = arrays[`cells_${number}`];
    const range = (array) => array.subarray(3 * this.start, 3 * this.end);
    this.positions = new THREE.BufferAttribute(range(this.bone < 0 ? hand.vertices : hand.rest), 3);
    this.normals = new THREE.BufferAttribute(range(hand.normals), 3);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", this.positions);
    geometry.setAttribute("normal", this.normals);
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(this.cells), 1));
    this.material = looks(geometry, data, arrays[`colours_${number}`]);
    this.meshes = meshesOf(geometry, this.material, number);
    for (const mesh of this.meshes) Object.assign(mesh, { frustumCulled: false, matrixAutoUpdate: false });
    normals(hand.rest, this.cells, this.start, this.end, hand.normals);
  }

  place() {
    const m = this.hand.motion, i = 12 * this.bone;
    for (const mesh of this.meshes) mesh.matrix.set(...m.subarray(i, i + 12), 0, 0, 0, 1);
  }

  shade() {
    normals(this.hand.vertices, this.cells, this.start, this.end, this.hand.normals);
    this.positions.needsUpdate = this.normals.needsUpdate = true;
  }

  /** Hides what is before a plane, or nothing. */
  cut(plane) { for (const mesh of this.meshes) mesh.material.clippingPlanes = plane ? [plane] : null; }

  show(on) { for (const mesh of this.meshes) mesh.visible = on; }
}

class Player {
  constructor(root, data, arrays) {
    this.root = root;
    this.data = data;
    this.hand = new LearnedHand(arrays);
    this.hand.normals = new Float32Array(this.hand.rest.length);
    this.angles = new Float64Array(data.angles.length);
    this.limits = data.angles.map((angle) => angle.limits);
    this.level = "L1";
    this.moved = true; // whether the hand has to be computed
    this.asked = false; // whether a frame is on its way
    this.playing = null; // the motion through the poses
    this.costs = { vertices: [], normals: [], drawing: [], between: [] }; // ms of the last frames
    this.canvas = this.find("canvas");
    this.space = new Space(this.canvas, this.find(".stage"), () => this.draw());
    this.bodies = data.bodies.map((body, number) => new Body(body, number, this.hand, arrays));
    for (const body of this.bodies) this.space.scene.add(...body.meshes);
    this.hidden = new Set(data.bodies.filter((body) => body.hidden).map((body) => body.layer));
    this.addTips();
    this.bindControls();
    this.listen();
    if (data.image) this.addSlice(arrays);
    if (data.landmarks) this.tracked = new Tracked(this, data.landmarks);
    this.hide();
    this.look(Object.keys(data.views)[0]);
  }

  find(selector) { return this.root.querySelector(selector); }

  addTips() {
    const ball = new THREE.SphereGeometry(TIP, 16, 12);
    this.tips = this.data.tips.map((tip) => {
      const material = new THREE.MeshBasicMaterial({ color: 0x1f7fd0, depthTest: false, transparent: true, opacity: 0.75 });
      const mesh = Object.assign(new THREE.Mesh(ball, material), { renderOrder: 1e6 });
      this.space.scene.add(mesh);
      return { ...tip, mesh };
    });
  }

  /** What the page's buttons, sliders and boxes do. */
  bindControls() {
    const each = (selector, event, act) => {
      for (const element of this.root.querySelectorAll(selector)) element.addEventListener(event, () => act(element));
    };
    each(".views button", "click", ({ value }) => this.look(value));
    each(".poses button", "click", ({ value }) => { this.stop(); this.set(this.data.poses[value]); });
    each(".play", "click", (button) => {
      if (this.playing?.button === button) this.stop();
      else this.play(button, Object.values(this.data.poses), { seconds: SECONDS, share: (t) => (1 - Math.cos(Math.PI * t)) / 2 });
    });
    each(".level", "change", ({ value }) => { this.level = value; this.change(); });
    each(".layers input", "change", ({ value, checked }) => { this.hidden[checked ? "delete" : "add"](value); this.hide(); });
    each(".opacity", "input", ({ value }) => {
      for (const body of this.bodies) if (body.layer === "skin") body.material.opacity = Number(value);
      this.draw();
    });
    this.sliders = this.data.angles.map(({ name }) => this.find(`input[name="${name}"]`));
    each(".angles input", "input", (slider) => {
      this.stop();
      this.angles[this.sliders.indexOf(slider)] = slider.value * DEGREE;
      this.change();
    });
  }

  addSlice(arrays) {
    const box = new THREE.Box3().setFromArray(this.hand.rest), sphere = box.getBoundingSphere(new THREE.Sphere());
    const skin = this.bodies.find((body) => body.layer === "skin"), [side, depth] = [this.find(".cut"), this.find(".depth")];
    this.slice = new Slice(this.hand, this.data.image, arrays.image, skin, this.bodies.filter((body) => body.bone >= 0), sphere);
    this.space.scene.add(this.slice.mesh);
    this.space.renderer.localClippingEnabled = true;
    this.costs.slice = [];
    Object.assign(depth, { min: -Math.floor(sphere.radius), max: Math.floor(sphere.radius), value: 0 });
    const turn = () => {
      this.slice.mesh.visible = side.value !== "";
      depth.disabled = side.value === "";
      depth.nextElementSibling.textContent = side.value ? `${depth.value} mm` : "";
      if (side.value) this.slice.place(this.data.views[side.value], Number(depth.value));
      for (const body of this.bodies) body.cut(side.value ? this.slice.plane : null);
      this.change();
    };
    side.addEventListener("change", () => { if (side.value) this.look(side.value); turn(); });
    depth.addEventListener("input", turn);
  }

  listen() {
    this.canvas.addEventListener("pointerdown", (e) => {
      const tip = e.button === 0 ? this.tipAt(e) : undefined;
      if (tip === undefined) return;
      this.stop();
      this.space.controls.enabled = false;
      this.canvas.setPointerCapture(e.pointerId);
      const place = tip.mesh.position.clone(), sight = this.space.camera.getWorldDirection(new THREE.Vector3());
      this.drag = { tip, plane: new THREE.Plane().setFromNormalAndCoplanarPoint(sight, place) };
    });
    this.canvas.addEventListener("pointermove", (e) => {
      if (!this.drag) { this.canvas.style.cursor = this.tipAt(e) ? "pointer" : ""; return; }
      const { ray } = this.space.rayAt(e), hit = ray.intersectPlane(this.drag.plane, new THREE.Vector3());
      if (!hit) return;
      Object.assign(this.drag, { target: hit.toArray(), sight: ray.direction.toArray(), frames: FRAMES, left: Infinity });
      this.change();
    });
    for (const end of ["pointerup", "pointercancel"]) {
      this.canvas.addEventListener(end, () => { this.drag = undefined; this.space.controls.enabled = true; });
    }
  }

  /** Where the canvas shows a fingertip, in pixels of the page. */
  onPage(tip) {
    const box = this.canvas.getBoundingClientRect(), { x, y } = tip.mesh.position.clone().project(this.space.camera);
    return [box.left + (x + 1) / 2 * box.width, box.top + (1 - y) / 2 * box.height];
  }

  tipAt(event) {
    const far = (tip) => { const [x, y] = this.onPage(tip); return Math.hypot(event.clientX - x, event.clientY - y); };
    return this.tips.filter((tip) => far(tip) < NEAR).sort((a, b) => far(a) - far(b))[0];
  }

  hide() {
    for (const body of this.bodies) body.show(!this.hidden.has(body.layer));
    this.change();
  }

  set(angles) { this.angles.set(angles); this.change(); }

  change() { this.moved = true; this.draw(); }

  /** Moves through poses, again and again, until stopped. Of a motion: `seconds` from pose to pose, `share` of the
      way by the share of this time, `reached` (if any) is told the number of the last pose. */
  play(button, poses, motion) {
    this.stop();
    this.playing = { began: performance.now(), from: [...this.angles], button, poses, ...motion };
    button.textContent = "Stop";
    this.change();
  }

  stop() {
    if (this.playing) this.playing.button.textContent = "Play";
    this.playing = null;
  }

  /** Angles of the motion from where it began through all poses. */
  along(now) {
    const { began, from, poses, seconds, share, reached } = this.playing;
    const time = Math.max(now - began, 0) / 1000 / seconds, n = Math.floor(time);
    const before = n === 0 ? from : poses[(n - 1) % poses.length], after = poses[n % poses.length];
    if (n > 0) reached?.((n - 1) % poses.length);
    return before.map((angle, i) => angle + share(time - n) * (after[i] - angle));
  }

  /** Computes the hand at the present angles; its costs in ms. The slice needs all vertices. */
  compute() {
    const shown = this.bodies.filter((body) => !this.hidden.has(body.layer)), soft = shown.filter((body) => body.bone < 0);
    const began = performance.now();
    const cut = this.slice?.mesh.visible;
    this.hand.pose(this.angles, this.level, cut ? undefined : soft.map(({ start, end }) => [start, end]));
    const posed = performance.now();
    for (const body of shown) if (body.bone < 0) body.shade(); else body.place();
    for (const { bone, point, mesh } of this.tips) mesh.position.set(...carried(this.hand.motion, bone, point));
    const shaded = performance.now();
    if (cut) this.slice.renew();
    return { vertices: posed - began, normals: shaded - posed, ...(cut && { slice: performance.now() - shaded }) };
  }

  /** Asks for one frame, however many changes there are until it is drawn. */
  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => { this.asked = false; this.frame(now); });
  }

  frame(now) {
    if (this.playing) this.angles.set(this.along(now));
    if (this.drag?.target) {
      const { tip, frames, ...pointer } = this.drag, goal = { ...tip, ...pointer };
      let left = reach(this.hand, this.angles, this.limits, goal, ITERATIONS);
      if (left > CLOSE && frames === AFRESH) left = reachAfresh(this.hand, this.angles, this.limits, goal, left);
      this.drag.left = left;
      if (this.drag.left > CLOSE && this.drag.frames-- > 0) this.change(); // nearer in the next frame
    }
    const moved = this.moved || this.playing !== null;
    this.moved = this.moved && this.asked;
    const computed = moved ? this.compute() : {};
    const began = performance.now();
    this.space.render();
    if (moved) this.tell(computed, performance.now() - began, now);
    if (this.playing) this.draw();
  }

  /** Sliders, alarm and costs in words. */
  tell(computed, drawing, now) {
    this.sliders.forEach((slider, i) => {
      slider.value = this.angles[i] / DEGREE;
      slider.nextElementSibling.textContent = `${(this.angles[i] / DEGREE).toFixed(0)}°`;
    });
    const distance = this.hand.distance(this.angles), alarm = this.find(".alarm");
    alarm.classList.toggle("on", distance > 1);
    alarm.textContent = distance > 1
      ? `This pose is unlike the learned ones (${distance.toFixed(2)} times their largest distance): the stated errors do not apply.`
      : `This pose is like the learned ones (${distance.toFixed(2)} of their largest distance): the stated errors apply.`;
    const values = { ...computed, drawing };
    if (this.last !== undefined) values.between = now - this.last;
    this.last = this.playing || this.drag ? now : undefined; // at rest no frame follows at once
    for (const [name, value] of Object.entries(values)) { this.costs[name].push(value); this.costs[name].splice(0, this.costs[name].length - KEPT); }
    const { costs } = this, rate = costs.between.length ? `, ${(1000 / mean(costs.between)).toFixed(0)} frames a second` : "";
    this.find(".cost").textContent = `A frame in motion: vertices ${mean(costs.vertices).toFixed(1)} ms, normals ${mean(costs.normals).toFixed(1)} ms, ${computed.slice ? `slice ${mean(costs.slice).toFixed(0)} ms, ` : ""}drawing calls ${mean(costs.drawing).toFixed(1)} ms${rate}.`;
  }

  /** Puts the camera on a side of the hand at rest. */
  look(view) {
    const box = new THREE.Box3().setFromArray(this.hand.rest);
    this.space.look(this.data.views[view], box.getBoundingSphere(new THREE.Sphere()));
  }
}

const main = document.querySelector("main");
try {
  const data = JSON.parse(document.getElementById("data").textContent);
  const arrays = await unpack(data.arrays, document.getElementById("packed").textContent);
  main.player = new Player(main, data, arrays);
} catch (error) {
  const words = `The hand cannot be shown: ${error.message}. The page needs WebGL 2 and a browser from 2023 or later.`;
  main.querySelector(".alarm").textContent = words;
  throw error;
}
