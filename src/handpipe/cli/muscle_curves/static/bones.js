/* The page of handpipe bones: each click through the skin is a point of a bone, and points are dragged. */

import * as THREE from "three";
import { Space, looks, meshesOf } from "space";
import { BONE, element, endPage, geometryOf, isStill, list, listenToKeys, listenToSkin, openPage, pixelsOf, put, say, skinOf } from "./view.js";
import { Editor, post } from "./editor.js";

const POINT = 0.012; // radius of a point, over that of the skin
const NEAR = 14; // pixels from a point at which a pointer takes it
const CHOSEN = [0.98, 0.8, 0.45];
const WORDS = {
  cylinder: ["Click the skin over one end of the bone (Esc: none)", "Click the skin over its other end"],
  shape: ["Click the skin over the middle of the bone (Esc: none)", "Click the skin over the end of its long axis"],
  curve: ["Click the skin over the begin of the row (Esc: none)", "Click the skin over the next point of the curve", "Click the next point, or press Done"],
};

class Page {
  constructor(settings, { arrays }) {
    this.canvas = document.querySelector("canvas");
    this.space = new Space(this.canvas, document.querySelector(".stage"), () => this.draw());
    this.drawn = new THREE.Group(); // bones and points, anew after each edit
    const { meshes, sphere } = skinOf(arrays);
    Object.assign(this, { skin: meshes, sphere, points: [] });
    meshes.at(-1).material.opacity = Number(element("skin").value);
    this.space.scene.add(this.drawn, ...meshes);
    this.ball = new THREE.SphereGeometry(POINT * sphere.radius, 16, 12);
    this.editor = new Editor((state) => this.show(state), (text) => { say(text, true); this.fill(); });
    for (const id of ["template", "own-template"]) {
      element(id).replaceChildren(...settings.templates.map((name) => new Option(name.replaceAll("_", " "), name)));
    }
    this.bind();
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.space.render(); });
  }

  /** Shows what the server answered. */
  show(state) {
    this.state = state;
    if (element("said").classList.contains("wrong")) say(""); // of an edit that is past
    if (!state.content.bones?.[this.chosen]) this.chosen = Object.keys(state.content.bones ?? {})[0];
    this.rebuild();
    this.fill();
    element("cost").textContent = state.seconds ? `The last edit took ${state.seconds.toFixed(2)} s.` : "";
  }

  rebuild() {
    for (const old of this.drawn.children) { if (old.geometry !== this.ball) old.geometry.dispose(); old.material.dispose(); }
    this.drawn.clear();
    this.points = [];
    const { arrays, bones, content } = this.state, rowOf = (name) => name.replace(/_\d+$/, "");
    bones.forEach((name, number) => {
      const own = name === this.chosen || (content.bones[this.chosen]?.kind === "curve" && rowOf(name) === this.chosen);
      this.drawn.add(...meshesOf(geometryOf(arrays, `bone/${name}`), looks(null, { colour: own ? CHOSEN : BONE, opacity: 1 }), number));
    });
    for (const [bone, { points }] of Object.entries(content.bones ?? {})) points.forEach((place, point) => this.addPoint(bone, point, place));
    this.draw();
  }

  addPoint(bone, point, place) {
    const own = bone === this.chosen, material = new THREE.MeshBasicMaterial({ color: own ? 0x0b5c8a : 0x8795a1, depthTest: false });
    const mesh = new THREE.Mesh(this.ball, material);
    mesh.position.set(...place);
    mesh.renderOrder = 5000;
    this.points.push({ bone, point, mesh, own });
    this.drawn.add(mesh);
  }

  choose(bone) {
    this.chosen = bone;
    this.rebuild();
    this.fill();
  }

  onPage(place) { return pixelsOf(this.canvas, this.space.camera, place); }

  pointAt(event) {
    const far = ({ mesh, own }) => { const [x, y] = this.onPage(mesh.position); return Math.hypot(event.clientX - x, event.clientY - y) + (own ? 0 : NEAR / 2); };
    return this.points.filter((p) => far(p) < NEAR).sort((a, b) => far(a) - far(b))[0];
  }

  /** The ray of a click, of which the server makes a point. */
  rayAt(event) {
    const { origin, direction } = this.space.rayAt(event).ray;
    return { ray: { origin: origin.toArray(), direction: direction.toArray() } };
  }

  onSkin(event) { return this.space.rayAt(event).intersectObject(this.skin.at(-1), false).length > 1; }

  press(event) {
    document.activeElement?.blur();
    if (event.button !== 0) return;
    this.pressed = [event.clientX, event.clientY];
    const found = this.wanted ? undefined : this.pointAt(event);
    if (!found) return;
    this.choose(found.bone);
    this.space.controls.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { bone: found.bone, point: found.point };
  }

  move(event) {
    if (!this.drag) { this.canvas.style.cursor = this.wanted ? "crosshair" : this.pointAt(event) ? "pointer" : ""; return; }
    if ((!this.drag.moved && isStill(this.pressed, event)) || !this.onSkin(event)) return;
    const { bone, point } = this.drag, ray = this.rayAt(event);
    this.editor.change((content) => { content.bones[bone].points[point] = ray; }, !this.drag.moved);
    this.drag.moved = true;
  }

  release(event) {
    if (this.drag) { this.drop(); return; }
    if (event.button === 0 && isStill(this.pressed, event) && this.wanted) this.give(event);
  }

  drop() {
    this.drag = undefined;
    this.space.controls.enabled = true;
  }

  /** Asks for points of a new bone: the next clicks. */
  ask(wanted) {
    this.wanted = wanted && { ...wanted, points: [] };
    element("done").hidden = true;
    say(wanted ? WORDS[wanted.kind][0] : "");
  }

  give(event) {
    const { kind, points } = this.wanted, words = WORDS[kind];
    if (!this.onSkin(event)) { say(`That is not on the skin. ${words[Math.min(points.length, words.length - 1)]}`, true); return; }
    points.push(this.rayAt(event));
    if (kind !== "curve" && points.length === 2) { this.make(); return; }
    element("done").hidden = points.length < 2;
    say(words[Math.min(points.length, words.length - 1)]);
  }

  make() {
    const { name, kind, template, points } = this.wanted;
    this.ask(null);
    element("name").value = "";
    this.chosen = name;
    this.editor.change((content) => { (content.bones ??= {})[name] = { kind, template, points }; });
  }

  fill() {
    const { content, faults } = this.state, bone = content.bones?.[this.chosen];
    list("faults", faults);
    element("muscles").replaceChildren(...Object.keys(content.bones ?? {}).map((name) => {
      const button = Object.assign(document.createElement("button"), { textContent: name, onclick: () => this.choose(name) });
      button.classList.toggle("chosen", name === this.chosen);
      return button;
    }));
    element("bone").hidden = !bone;
    element("undo").disabled = !this.editor.before.length;
    element("redo").disabled = !this.editor.after.length;
    if (!bone) return;
    element("chosen").textContent = this.chosen;
    element("place").textContent = `Points at ${bone.points.map((p) => `(${p.map((x) => x.toFixed(1)).join(", ")})`).join(" ")} mm`;
    element("of-radius").hidden = bone.kind === "shape";
    element("of-count").hidden = bone.kind !== "curve";
    put("own-template", bone.template ?? "rod");
    put("radius", bone.radius ?? "");
    put("count", bone.count ?? 5);
  }

  /** Change the chosen bone. */
  bone(change) { const { chosen } = this; this.editor.change(({ bones }) => change(bones[chosen])); }

  bind() {
    const on = (id, event, act) => element(id).addEventListener(event, (e) => act(element(id), e));
    this.canvas.addEventListener("pointerdown", (e) => this.press(e));
    this.canvas.addEventListener("pointermove", (e) => this.move(e));
    this.canvas.addEventListener("pointerup", (e) => this.release(e));
    this.canvas.addEventListener("pointercancel", () => this.drop());
    listenToKeys(this.editor, { escape: () => this.ask(null), remove: () => this.remove() });
    listenToSkin(this.skin, () => this.draw());
    on("undo", "click", () => this.editor.undo());
    on("redo", "click", () => this.editor.redo());
    on("save", "click", () => this.save());
    on("end", "click", () => endPage(this.editor));
    on("new", "submit", (_, event) => {
      event.preventDefault();
      const [name, kind, template] = ["name", "kind", "template"].map((id) => element(id).value);
      if (this.state.content.bones?.[name]) { say(`There is a bone ${name}`, true); return; }
      document.activeElement?.blur();
      this.ask({ name, kind, template });
    });
    on("done", "click", () => this.make());
    on("own-template", "change", ({ value }) => this.bone((bone) => { bone.template = value; }));
    on("radius", "change", ({ value }) => this.bone((bone) => { if (value > 0) bone.radius = Number(value); else delete bone.radius; }));
    on("count", "change", ({ value }) => this.bone((bone) => { bone.count = Number(value); }));
    on("delete", "click", () => this.remove());
  }

  remove() { const { chosen } = this; if (chosen) this.editor.change(({ bones }) => { delete bones[chosen]; }); }

  async save() {
    await this.editor.running;
    say("Saving");
    try {
      const { said } = await (await post("save")).json();
      this.editor.saved = true;
      say(said);
    } catch (error) {
      say(error.message, true);
    }
  }

}

await openPage((settings, surfaces) => new Page(settings, surfaces));
