/* The simulated pose: a joint that the bones propose, its angle, the solve on the server, what it ended with. */

import * as THREE from "three";
import { looks, meshesOf } from "space";
import { BONE, SKIN, element, geometryOf, put, say } from "./view.js";
import { get, post } from "./editor.js";

const OFTEN = 400; // ms from one question how far the solve is to the next
const AXIS = 0.35; // length of an axis that is drawn, over the radius of the skin
const GHOST = { colour: [0.04, 0.36, 0.54], opacity: 0.45 };
const numbers = (text) => text.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));

export class Pose {
  /** Of a page; `colour` gives that of a muscle by its place in the file. */
  constructor(page, colour) {
    Object.assign(this, { page, colour, joints: {}, ghost: new THREE.Group(), posed: null });
    page.space.scene.add(this.ghost);
    this.bind();
  }

  get bone() { return element("pose-bone").value; }

  get moving() { return [this.bone, ...[...document.querySelectorAll("#pose-moving input:checked")].map(({ value }) => value)]; }

  bind() {
    const on = (id, event, act) => element(id).addEventListener(event, act);
    on("pose", "toggle", () => { if (element("pose").open) this.open(); else this.preview(); });
    on("pose-bone", "change", () => { this.propose(); this.preview(); });
    for (const id of ["pose-axis", "pose-centre", "pose-moving"]) on(id, "change", () => this.preview());
    on("pose-angle", "input", () => { element("pose-degrees").value = element("pose-angle").value; this.preview(); });
    on("pose-degrees", "input", () => { element("pose-angle").value = element("pose-degrees").value; this.preview(); });
    on("simulate", "click", () => this.simulate());
    on("rest", "click", () => this.rest());
  }

  async open() {
    try {
      this.joints = await (await fetch("joints.json")).json();
    } catch (error) {
      say(error.message, true);
    }
    const before = this.bone, bones = Object.keys(this.joints);
    element("pose-bone").replaceChildren(...bones.map((bone) => new Option(bone)));
    if (bones.includes(before)) element("pose-bone").value = before;
    element("simulate").disabled = !bones.length;
    if (bones.length) this.propose(); else element("pose-joint").textContent = "A joint needs two bones.";
    this.fill();
    this.preview();
  }

  /** The joint of the chosen bone, as it is proposed. */
  propose() {
    const { parent, moving, centre } = this.joints[this.bone];
    element("pose-joint").textContent = `${this.bone} turns on ${parent}. The centre is proposed from the gap of their ends, the axes from the bone and the front (z): look whether the blue bones move as they should.`;
    element("pose-centre").value = centre.join(", ");
    const others = this.page.settings.bones.filter((bone) => bone !== this.bone && bone !== parent);
    element("pose-moving").replaceChildren(...others.map((bone) => {
      const label = document.createElement("label"), box = Object.assign(document.createElement("input"), { type: "checkbox", value: bone });
      box.checked = moving.includes(bone);
      label.append(box, bone);
      return label;
    }));
  }

  /** The muscles to choose from. */
  fill() {
    const before = element("pose-muscle").value, names = Object.keys(this.page.state.content.muscles ?? {});
    element("pose-muscle").replaceChildren(new Option("none", ""), ...names.map((name) => new Option(name)));
    if (names.includes(before)) element("pose-muscle").value = before;
  }

  /** Shows the moving bones turned, and the axis. */
  preview() {
    for (const old of this.ghost.children) { old.material.dispose(); if (old.userData.own) old.geometry.dispose(); }
    this.ghost.clear();
    const joint = this.joints[this.bone], centre = new THREE.Vector3(...numbers(element("pose-centre").value));
    if (element("pose").open && joint && !this.posed && Number.isFinite(centre.length())) {
      const axis = new THREE.Vector3(...joint.axes[element("pose-axis").value]);
      const angle = THREE.MathUtils.degToRad(Number(element("pose-degrees").value));
      const turn = new THREE.Matrix4().makeTranslation(centre).multiply(new THREE.Matrix4().makeRotationAxis(axis, angle)).multiply(new THREE.Matrix4().makeTranslation(centre.clone().negate()));
      for (const mesh of this.page.bones.filter(({ userData }) => this.moving.includes(userData.bone))) {
        const ghost = new THREE.Mesh(mesh.geometry, looks(null, GHOST));
        ghost.applyMatrix4(turn);
        this.ghost.add(ghost);
      }
      const reach = AXIS * this.page.sphere.radius, ends = [-1, 1].map((side) => centre.clone().addScaledVector(axis, side * reach));
      const line = new THREE.Line(new THREE.BufferGeometry().setFromPoints(ends), new THREE.LineBasicMaterial({ color: 0xb3261e, depthTest: false }));
      this.ghost.add(Object.assign(line, { renderOrder: 1e6, userData: { own: true } }));
    }
    this.page.draw();
  }

  async simulate() {
    await this.page.editor.running;
    const value = (id) => element(id).value, asked = {
      bone: this.bone, moving: this.moving, axis: value("pose-axis"), centre: numbers(value("pose-centre")),
      angle: value("pose-degrees") === "" ? null : Number(value("pose-degrees")),
      muscle: value("pose-muscle") || null, shortening: Number(value("pose-shortening")),
    };
    try {
      this.leave();
      say((await (await post("pose", JSON.stringify(asked))).json()).said);
    } catch (error) {
      say(error.message, true);
      return;
    }
    this.asking = setTimeout(() => this.follow(), OFTEN);
    this.buttons();
  }

  /** Asks how far the solve is, until it has ended. */
  async follow() {
    const asked = this.asking;
    try {
      const told = await (await fetch("pose.json")).json();
      if (this.asking !== asked) return; // left in the meantime
      if (told.state === "running") {
        if (told.step) say(`Step ${told.step} of ${told.steps}: ${told.degrees.toFixed(0)} degrees, residual ${told.residual.toExponential(1)} mN`);
        this.asking = setTimeout(() => this.follow(), OFTEN);
        return;
      }
      this.asking = null;
      if (told.state === "done") this.show((await get("posed")).arrays);
      say(told.said ?? "At rest", told.state === "failed");
    } catch (error) {
      this.asking = null;
      say(error.message, true);
    }
    this.buttons();
  }

  buttons() {
    element("simulate").disabled = Boolean(this.asking);
    element("rest").disabled = !this.asking && !this.posed;
    element("rest").textContent = this.asking ? "Stop" : "Back to rest";
  }

  show(arrays) {
    this.posed = { arrays, group: new THREE.Group() };
    this.page.space.scene.add(this.posed.group);
    this.rebuild();
    this.preview();
  }

  /** Draws the pose as the sliders and boxes of the page say. */
  rebuild() {
    this.page.showRest(!this.posed);
    if (!this.posed) return;
    const { arrays, group } = this.posed, add = (name, look, order) => group.add(...meshesOf(geometryOf(arrays, name), looks(null, look), order));
    this.clear();
    const skin = Number(element("skin").value);
    if (element("show-bones").checked) this.page.settings.bones.forEach((bone, i) => add(`bone/${bone}`, { colour: BONE, opacity: 1 }, i));
    if (element("show-muscles").checked) {
      const opacity = Number(element("opacity").value);
      Object.keys(this.page.state.content.muscles).forEach((name, i) => add(`muscle/${name}`, { colour: this.colour(i), opacity }, 100 + i));
    }
    if (skin > 0) add("skin", { colour: SKIN, opacity: skin }, 1000);
    this.page.draw();
  }

  clear() {
    for (const old of this.posed.group.children) { old.geometry.dispose(); old.material.dispose(); }
    this.posed.group.clear();
  }

  /** What is shown of the pose goes. */
  leave() {
    clearTimeout(this.asking);
    this.asking = null;
    if (this.posed) { this.clear(); this.posed.group.removeFromParent(); }
    this.posed = null;
    this.rebuild();
    this.buttons();
    this.preview();
  }

  async rest() {
    this.leave();
    try {
      say((await (await post("rest")).json()).said);
    } catch (error) {
      say(error.message, true);
    }
  }
}
