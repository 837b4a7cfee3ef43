/* The 3D view of a report: one canvas, the scenes of the page by their JSON, drawn by three.js. */

import * as THREE from "three";
import { Space, looks, meshesOf } from "space";

const STEP = 0.1; // radians or octaves that a key turns or zooms
const KEYS = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] };

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

/** A body of a scene: one geometry whose positions are those of the frame that is shown. */
class Body {
  constructor(data, scene, order) {
    this.name = data.name;
    this.layer = data.layer;
    this.opaque = data.opacity === 1;
    this.low = scene.low;
    this.scale = scene.scale;
    this.integers = new Uint16Array(bytes(data.positions));
    this.size = this.integers.length / scene.frames.length;
    this.positions = new THREE.BufferAttribute(new Float32Array(this.size), 3);
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute("position", this.positions);
    this.geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(bytes(data.triangles)), 1));
    const srgb = data.colours && new Uint8Array(bytes(data.colours)); // of vertices: nails on the skin
    this.meshes = meshesOf(this.geometry, looks(this.geometry, data, srgb), order);
    this.mesh = this.meshes.at(-1);
    this.mesh.userData.body = this;
  }

  show(frame) {
    const { array } = this.positions, start = frame * this.size;
    for (let i = 0; i < this.size; i++) array[i] = this.low[i % 3] + this.scale * this.integers[start + i];
    this.positions.needsUpdate = true;
    this.geometry.computeVertexNormals();
    this.geometry.computeBoundingSphere();
    this.geometry.computeBoundingBox();
  }

  light(on) {
    this.mesh.material.emissive.setScalar(on ? 0.25 : 0);
  }

  dispose() {
    this.geometry.dispose();
    for (const mesh of this.meshes) mesh.material.dispose();
  }
}

class Viewer {
  constructor(figure) {
    this.figure = figure;
    this.canvas = this.find("canvas");
    this.asked = false; // whether a picture is on its way
    this.space = new Space(this.canvas, this.find(".stage"), () => this.draw());
    this.bodies = [];
    this.hidden = new Set(); // layers
    this.known = new Set(); // layers of which a scene has told whether they are hidden at first
    this.playing = null;
    this.listen();
    this.open(this.find("select.scene").value);
  }

  get camera() { return this.space.camera; }

  get controls() { return this.space.controls; }

  find(selector) { return this.figure.querySelector(selector); }

  listen() {
    this.find("select.scene").addEventListener("change", (e) => this.open(e.target.value));
    this.find("input.frame").addEventListener("input", (e) => { this.stop(); this.show(Number(e.target.value)); });
    this.find("button.play").addEventListener("click", () => (this.playing === null ? this.play() : this.stop()));
    this.find("select.rate").addEventListener("change", () => { if (this.playing !== null) { this.stop(); this.play(); } });
    this.canvas.addEventListener("pointermove", (e) => { this.pointer = e.buttons ? null : e; this.draw(); });
    this.canvas.addEventListener("pointerleave", () => { this.pointer = null; this.draw(); });
    this.canvas.addEventListener("keydown", (e) => this.key(e));
  }

  /** Shows the scene whose JSON has an id. */
  open(id) {
    this.stop();
    for (const body of this.bodies) { this.space.scene.remove(...body.meshes); body.dispose(); }
    this.picked = null;
    this.scene = JSON.parse(document.getElementById(id).textContent);
    this.bodies = this.scene.bodies.map((data, order) => new Body(data, this.scene, order));
    for (const body of this.bodies) this.space.scene.add(...body.meshes);
    const { frames, total } = this.scene, slider = this.find("input.frame");
    slider.max = frames.length - 1;
    this.find("button.play").disabled = slider.disabled = frames.length < 2;
    this.find("select.rate").value = frames.length > 100 ? "24" : frames.length > 30 ? "12" : frames.length > 8 ? "4" : "1";
    this.find(".chosen").textContent = frames.length < total ? `${frames.length} of ${total} frames are shown.` : "";
    for (const layer of this.scene.hidden) if (!this.known.has(layer)) this.hidden.add(layer);
    for (const layer of this.scene.hidden) this.known.add(layer);
    this.addButtons();
    this.addLayers();
    this.show(0);
    this.look(Object.keys(this.scene.views)[0]);
  }

  addButtons() {
    this.find(".views").replaceChildren(...Object.keys(this.scene.views).map((view) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = view;
      button.addEventListener("click", () => this.look(view));
      return button;
    }));
  }

  addLayers() {
    const colours = new Map(this.scene.bodies.map((b) => [b.layer, b.colour]));
    this.find(".layers").replaceChildren(...[...colours].map(([layer, colour]) => {
      const label = document.createElement("label"), box = document.createElement("input");
      const swatch = document.createElement("span");
      box.type = "checkbox";
      box.checked = !this.hidden.has(layer);
      box.addEventListener("change", () => {
        this.hidden[box.checked ? "delete" : "add"](layer);
        this.hide();
        this.draw();
      });
      swatch.className = "swatch";
      swatch.style.background = `rgb(${colour.map((c) => Math.round(255 * c))})`;
      label.append(box, swatch, layer);
      return label;
    }));
    this.hide();
  }

  hide() {
    for (const body of this.bodies) for (const mesh of body.meshes) mesh.visible = !this.hidden.has(body.layer);
  }

  show(frame) {
    this.frame = frame;
    for (const body of this.bodies) body.show(frame);
    this.find("input.frame").value = frame;
    this.find("output.name").textContent = this.scene.frames[frame];
    this.draw();
  }

  play() {
    this.find("button.play").textContent = "Pause";
    const step = () => this.show((this.frame + 1) % this.scene.frames.length);
    this.playing = setInterval(step, 1000 / Number(this.find("select.rate").value));
  }

  stop() {
    clearInterval(this.playing);
    this.playing = null;
    this.find("button.play").textContent = "Play";
  }

  /** The smallest sphere about the middle of what is shown, in mm. */
  extent() {
    const box = new THREE.Box3();
    for (const body of this.bodies) box.union(body.geometry.boundingBox);
    return box.isEmpty() ? new THREE.Sphere(new THREE.Vector3(), 1) : box.getBoundingSphere(new THREE.Sphere());
  }

  /** Puts the camera on a side of the hand as it is in this frame; without a name, on +z. */
  look(view) {
    this.space.look(view ? this.scene.views[view][this.frame] : [0, 0, 1, 0, 1, 0], this.extent());
  }

  key(event) {
    if (event.key in KEYS) this.turn(...KEYS[event.key]);
    else if (event.key === "+" || event.key === "-") this.zoom(event.key === "+" ? -STEP : STEP);
    else return;
    event.preventDefault();
  }

  turn(aside, down) {
    const { target } = this.controls, from = this.camera.position.clone().sub(target);
    const right = new THREE.Vector3().crossVectors(this.camera.up, from).normalize();
    from.applyAxisAngle(this.camera.up, aside).applyAxisAngle(right, down);
    this.camera.position.copy(target).add(from);
    this.controls.update();
    this.draw();
  }

  zoom(octaves) {
    const { target } = this.controls;
    this.camera.position.sub(target).multiplyScalar(2 ** octaves).add(target);
    this.controls.update();
    this.draw();
  }

  /** The body under the pointer: the foremost opaque one, or else the foremost. */
  pick(event) {
    const ray = this.space.rayAt(event);
    const visible = this.bodies.map((b) => b.mesh).filter((mesh) => mesh.visible);
    const hits = ray.intersectObjects(visible, false).map((hit) => hit.object.userData.body);
    return hits.find((body) => body.opaque) ?? hits[0] ?? null;
  }

  /** Names the body under the pointer beside it. */
  point() {
    const body = this.pointer ? this.pick(this.pointer) : null, label = this.find("output.picked");
    if (body !== this.picked) { this.picked?.light(false); body?.light(true); this.picked = body; }
    label.hidden = body === null;
    if (body === null) return;
    const box = this.canvas.getBoundingClientRect();
    label.textContent = body.name === body.layer ? body.name : `${body.name} (${body.layer})`;
    label.style.left = `${this.pointer.clientX - box.left + 14}px`;
    label.style.top = `${this.pointer.clientY - box.top + 14}px`;
  }

  /** Asks for one picture, however many changes there are until it is drawn. */
  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.point();
      this.space.render();
    });
  }
}

function start(figure) {
  try {
    figure.viewer = new Viewer(figure);
  } catch (error) {
    const text = document.createElement("p");
    text.textContent = `The 3D view cannot be shown: ${error.message}`;
    figure.replaceChildren(text);
    throw error;
  }
}

document.querySelectorAll("figure.view").forEach(start);
