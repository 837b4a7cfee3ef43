/* The page of handpipe curves: a 3D view with points to drag, and fields of what is chosen. */

import * as THREE from "three";
import { Space, looks, meshesOf } from "space";
import { BONE, element, endPage, geometryOf, isStill, list, listenToKeys, listenToSkin, openPage, pixelsOf, put, say, skinOf } from "./view.js";
import { Pose } from "./pose.js";
import { Editor, anyNormal, get, inSpace, newAttachment, newCurve, onBone, pointsAt, post } from "./editor.js";

const POINT = 0.012; // radius of a point, over that of the skin
const TENDON = -1; // in place of a muscle's number: a grey line
const NEAR = 14; // pixels from a point at which a pointer takes it
const same = (a, b) => a && b && a.muscle === b.muscle && a.kind === b.kind && a.list === b.list && a.point === b.point;

/** Colour of a muscle by its place in the file, sRGB from 0 to 1. */
function colour(number) {
  const { r, g, b } = new THREE.Color().setHSL((number * 0.618034) % 1, 0.55, 0.52).getRGB({}, THREE.SRGBColorSpace);
  return [r, g, b];
}

class Page {
  constructor(settings, statics) {
    this.settings = settings;
    this.latencies = []; // ms from each edit to its view
    this.canvas = document.querySelector("canvas");
    this.space = new Space(this.canvas, document.querySelector(".stage"), () => this.draw());
    this.drawn = new THREE.Group(); // muscles, lines and points, anew after each edit
    this.space.scene.add(this.drawn);
    this.addStatics(statics);
    this.editor = new Editor((state, asked) => this.show(state, asked), (text) => { say(text, true); this.fill(); });
    this.pose = new Pose(this, colour);
    this.bind();
    this.listen();
  }

  addStatics({ arrays }) {
    this.bones = [];
    this.settings.bones.forEach((bone, number) => {
      const meshes = meshesOf(geometryOf(arrays, `bone/${bone}`), looks(null, { colour: BONE, opacity: 1 }), number);
      for (const mesh of meshes) mesh.userData.bone = bone;
      this.bones.push(...meshes);
    });
    const { meshes, sphere } = skinOf(arrays);
    this.space.scene.add(...this.bones, ...meshes);
    Object.assign(this, { skin: meshes, sphere });
    this.ball = new THREE.SphereGeometry(POINT * this.sphere.radius, 16, 12);
    const side = 1.6 * POINT * this.sphere.radius;
    this.cube = new THREE.BoxGeometry(side, side, side);
  }

  /** Shows what the server answered. */
  show(state, asked) {
    this.state = state;
    if (element("said").classList.contains("wrong")) say(""); // of an edit that is past
    this.fibres = undefined; // those of tets that are made of other curves
    this.pose.leave(); // as the server has done, where anything has changed
    const names = Object.keys(state.content.muscles ?? {});
    if (!names.includes(this.chosen?.muscle)) this.chosen = names.length ? { muscle: names[0] } : undefined;
    if (this.chosen?.kind && !pointsAt(state.content, this.chosen)?.[this.chosen.point]) this.chosen = { muscle: this.chosen.muscle };
    this.rebuild();
    this.fill();
    this.pose.fill();
    this.draw(() => {
      this.latencies.push(performance.now() - asked);
      const last = state.seconds && ` The last edit took ${state.seconds.toFixed(2)} s, and ${(this.latencies.at(-1) / 1000).toFixed(2)} s until it was drawn.`;
      element("cost").textContent = `${this.settings.tets} tets.${last || ""}`;
    });
  }

  rebuild() {
    for (const old of this.drawn.children) { if (![this.ball, this.cube].includes(old.geometry)) old.geometry.dispose(); old.material.dispose(); }
    this.drawn.clear();
    this.muscles = [];
    this.points = [];
    const { arrays, places, content } = this.state;
    Object.keys(content.muscles ?? {}).forEach((muscle, number) => {
      this.addMuscle(muscle, number, arrays);
      const own = muscle === this.chosen?.muscle;
      for (let i = 0; arrays[`line/${muscle}/${i}`]; i++) this.addLine(arrays[`line/${muscle}/${i}`], number, own);
      for (const kind of ["curves", "attachments"]) {
        places[muscle][kind].forEach((list, l) => list.forEach((place, point) => this.addPoint({ muscle, kind, list: l, point }, place, number)));
      }
    });
    for (const [name, points] of Object.entries(arrays)) if (name.startsWith("tendon/")) this.addLine(points, TENDON, true);
    if (this.fibres) this.addFibres();
  }

  addMuscle(muscle, number, arrays) {
    if (!arrays[`muscle/${muscle}/vertices`] || !element("show-muscles").checked) return;
    const look = { colour: colour(number), opacity: Number(element("opacity").value) };
    const geometry = geometryOf(arrays, `muscle/${muscle}`), meshes = meshesOf(geometry, looks(null, look), 100 + number);
    for (const mesh of meshes) mesh.userData.muscle = muscle;
    this.muscles.push(meshes.at(-1));
    this.drawn.add(...meshes);
  }

  addFibres() {
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(this.fibres, 3));
    const material = new THREE.LineBasicMaterial({ color: 0x5a1f1f, depthTest: false, transparent: true, opacity: 0.5 });
    this.drawn.add(Object.assign(new THREE.LineSegments(geometry, material), { renderOrder: 1e4 }));
  }

  addLine(points, number, own) {
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(points, 3));
    const shade = number === TENDON ? new THREE.Color(0x777777) : new THREE.Color().setRGB(...colour(number), THREE.SRGBColorSpace).multiplyScalar(0.35);
    const material = new THREE.LineBasicMaterial({ color: shade, depthTest: false, transparent: true, opacity: own ? 1 : 0.45 });
    this.drawn.add(Object.assign(new THREE.Line(geometry, material), { renderOrder: 1e5 }));
  }

  addPoint(id, place, number) {
    const own = id.muscle === this.chosen?.muscle, chosen = same(id, this.chosen);
    const shade = chosen ? 0xffc400 : new THREE.Color().setRGB(...colour(number), THREE.SRGBColorSpace).multiplyScalar(0.6);
    const material = new THREE.MeshBasicMaterial({ color: shade, depthTest: false, transparent: true, opacity: own ? 0.95 : 0.4 });
    const mesh = Object.assign(new THREE.Mesh(id.kind === "curves" ? this.ball : this.cube, material), { renderOrder: 1e6 });
    mesh.position.set(...place);
    mesh.scale.setScalar(own ? 1 : 0.6);
    this.points.push({ id, mesh, own });
    this.drawn.add(mesh);
  }

  /** Shows or hides what is drawn at rest. */
  showRest(shown) {
    this.drawn.visible = shown;
    for (const mesh of this.bones) mesh.visible = shown && element("show-bones").checked;
    for (const mesh of this.skin) mesh.visible = shown && Number(element("skin").value) > 0;
    this.draw();
  }

  /** One frame, however many changes there are until it is drawn; then what is to be done after it. */
  draw(after) {
    if (after) (this.afterwards ??= []).push(after);
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.space.render();
      for (const act of this.afterwards ?? []) act();
      this.afterwards = [];
    });
  }

  choose(id) {
    this.chosen = id;
    this.rebuild();
    this.fill();
    this.draw();
  }

  listen() {
    this.canvas.addEventListener("pointerdown", (e) => this.press(e));
    this.canvas.addEventListener("pointermove", (e) => this.move(e));
    this.canvas.addEventListener("pointerup", (e) => this.release(e));
    this.canvas.addEventListener("pointercancel", () => this.drop());
    listenToKeys(this.editor, { escape: () => this.ask(null), remove: () => { if (this.chosen?.kind) this.deletePoint(); } });
  }

  press(event) {
    document.activeElement?.blur(); // what was written counts for the point that was chosen
    if (event.button !== 0) return;
    this.pressed = [event.clientX, event.clientY];
    const found = this.wanted || this.pose.posed ? undefined : this.pointAt(event);
    if (!found) return;
    this.choose(found.id);
    this.space.controls.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
    const sight = this.space.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(sight, found.mesh.position.clone());
    this.drag = { id: found.id, plane, bone: pointsAt(this.editor.content, found.id)[found.id.point].bone };
  }

  move(event) {
    if (!this.drag) { this.canvas.style.cursor = this.wanted ? "crosshair" : this.pointAt(event) ? "pointer" : ""; return; }
    if (!this.drag.moved && this.isClick(event)) return;
    const { id, plane, bone } = this.drag, caster = this.space.rayAt(event);
    const hit = bone ? this.boneAt(event) : { point: caster.ray.intersectPlane(plane, new THREE.Vector3())?.toArray() };
    if (!hit?.point) return;
    const first = !this.drag.moved;
    this.drag.moved = true;
    const handle = this.points.find((p) => same(p.id, id));
    handle?.mesh.position.set(...hit.point);
    this.editor.change((content) => {
      const points = pointsAt(content, id);
      points[id.point] = bone ? onBone(points[id.point], hit.point, hit.bone) : inSpace(points[id.point], hit.point);
    }, first);
  }

  release(event) {
    const click = this.isClick(event) && event.button === 0;
    if (this.drag) { this.drop(); return; }
    if (!click) return;
    if (this.wanted) { this.give(event); return; }
    if (this.pose.posed) return;
    const [hit] = this.space.rayAt(event).intersectObjects(this.muscles, false);
    if (hit && hit.object.userData.muscle !== this.chosen?.muscle) this.choose({ muscle: hit.object.userData.muscle });
  }

  drop() {
    this.drag = undefined;
    this.space.controls.enabled = true;
  }

  isClick(event) { return isStill(this.pressed, event); }

  /** Where the canvas shows a place, in pixels of the page. */
  onPage(place) { return pixelsOf(this.canvas, this.space.camera, place); }

  /** The nearest point to a pointer, those of the chosen muscle first. */
  pointAt(event) {
    const far = ({ mesh, own }) => { const [x, y] = this.onPage(mesh.position); return Math.hypot(event.clientX - x, event.clientY - y) + (own ? 0 : NEAR / 2); };
    return this.points.filter((p) => far(p) < NEAR).sort((a, b) => far(a) - far(b))[0];
  }

  boneAt(event) {
    const [hit] = this.space.rayAt(event).intersectObjects(this.bones, false);
    return hit && { point: hit.point.toArray(), bone: hit.object.userData.bone };
  }

  /** Asks for places on bones: the next clicks. */
  ask(wanted) {
    if (wanted && this.pose.posed) this.pose.leave();
    this.wanted = wanted && { ...wanted, places: [] };
    say(wanted ? wanted.words[0] : "");
  }

  give(event) {
    const hit = this.boneAt(event), { places, words, act } = this.wanted;
    if (!hit) { say(`That is no bone. ${words[places.length]}`, true); return; }
    places.push(hit);
    if (places.length < words.length) { say(words[places.length]); return; }
    this.ask(null);
    act(...places);
  }

  askForCurve(act) {
    const words = ["Click the place on a bone where it begins (Esc: none)", "Click the place on a bone where it ends"];
    this.ask({ words, act: (origin, insertion) => act(newCurve(origin, insertion)) });
  }

  /** Fields and lists beside the view. */
  fill() {
    const { content, faults, warnings } = this.state, muscle = content.muscles?.[this.chosen?.muscle];
    list("faults", faults);
    list("warnings", warnings);
    put("fat", content.fat ?? 0.5);
    element("muscles").replaceChildren(...Object.keys(content.muscles ?? {}).map((name, number) => this.muscleButton(name, number)));
    element("muscle").hidden = !muscle;
    element("point").hidden = !this.chosen?.kind;
    element("undo").disabled = !this.editor.before.length;
    element("redo").disabled = !this.editor.after.length;
    if (!muscle) return;
    element("chosen").textContent = this.chosen.muscle;
    put("reach", muscle.reach ?? 3);
    put("volume", muscle.volume ?? "");
    put("edge_length", muscle.edge_length ?? "");
    put("fibres", muscle.fibres ?? "gradient");
    element("delete-curve").disabled = muscle.curves.length < 2 || this.chosen.kind !== "curves";
    if (this.chosen.kind) this.fillPoint(muscle);
  }

  fillPoint(muscle) {
    const { kind, list, point } = this.chosen, one = muscle[kind][list].points[point], curve = kind === "curves";
    const place = this.state.places[this.chosen.muscle][kind][list][point].map((x) => x.toFixed(1)).join(", ");
    const what = curve ? `${point + 1} of curve ${list + 1}` : `attachment of the ${muscle.attachments[list].end}`;
    element("place").textContent = `${what}, ${one.bone ? `on ${one.bone}` : "in space"}, at (${place}) mm`;
    element("values").hidden = !curve;
    element("add-point").hidden = !curve;
    element("attachment-reach").hidden = curve;
    put("tissue", one.tissue ?? 1);
    put("spread-0", one.spread?.[0] ?? 1);
    put("spread-1", one.spread?.[1] ?? 1);
    put("normal", muscle.curves[curve ? list : 0].normal?.join(", ") ?? "");
    put("own-reach", curve ? "" : muscle.attachments[list].reach ?? 3);
    element("to-bone").disabled = Boolean(one.bone);
    element("to-space").disabled = !one.bone;
  }

  muscleButton(name, number) {
    const button = document.createElement("button"), square = document.createElement("i");
    square.style.background = `rgb(${colour(number).map((c) => 255 * c).join(" ")})`;
    button.append(square, name);
    button.classList.toggle("chosen", name === this.chosen?.muscle);
    button.onclick = () => this.choose({ muscle: name });
    return button;
  }

  /** Change the chosen point. */
  point(change) {
    const at = this.chosen;
    this.editor.change((content) => { const points = pointsAt(content, at); points[at.point] = change(points[at.point]); });
  }

  /** Change the chosen muscle. */
  muscle(change) {
    const { muscle } = this.chosen;
    this.editor.change((content) => change(content.muscles[muscle]));
  }

  place() {
    const { muscle, kind, list, point } = this.chosen;
    return this.state.places[muscle][kind][list][point];
  }

  deletePoint() {
    const { kind, list, point } = this.chosen;
    if (kind === "curves" && pointsAt(this.editor.content, this.chosen).length < 3) { say("A curve has two points at least", true); return; }
    this.muscle((muscle) => {
      muscle[kind][list].points.splice(point, 1);
      if (!muscle[kind][list].points.length) muscle[kind].splice(list, 1);
    });
  }

  /** A point halfway to the next one, or from the last one but one to the last. */
  insertPoint() {
    const { muscle, list, point } = this.chosen, places = this.state.places[muscle].curves[list];
    const first = Math.min(point, places.length - 2), middle = places[first].map((x, i) => (x + places[first + 1][i]) / 2);
    this.chosen = { ...this.chosen, point: first + 1 };
    this.muscle(({ curves }) => {
      const { points } = curves[list], value = ((points[first].tissue ?? 1) + (points[first + 1].tissue ?? 1)) / 2;
      points.splice(first + 1, 0, inSpace({ ...points[first], tissue: value }, middle));
    });
  }

  spread(axis, value) {
    const { muscle, list, point } = this.chosen, places = this.state.places[muscle].curves[list];
    this.muscle(({ curves }) => {
      const curve = curves[list], one = curve.points[point], rates = [...(one.spread ?? [1, 1])];
      rates[axis] = value;
      one.spread = rates;
      curve.normal ??= anyNormal(places);
    });
  }

  bind() {
    const on = (id, event, act) => element(id).addEventListener(event, () => act(element(id)));
    const number = (id, act) => on(id, "change", ({ value }) => { if (Number(value) > 0) act(Number(value)); else { element(id).blur(); this.fill(); } });
    on("undo", "click", () => this.editor.undo());
    on("redo", "click", () => this.editor.redo());
    on("save", "click", () => this.request("save", "Saving"));
    on("tets", "click", () => this.request("tets", "Making tets, which takes some seconds to minutes"));
    on("end", "click", () => endPage(this.editor));
    on("show-bones", "change", () => this.pose.rebuild());
    on("show-muscles", "change", () => { this.rebuild(); this.pose.rebuild(); });
    on("opacity", "input", () => { this.rebuild(); this.pose.rebuild(); });
    listenToSkin(this.skin, () => this.pose.rebuild());
    number("fat", (value) => this.editor.change((content) => { content.fat = value; }));
    number("reach", (value) => this.muscle((muscle) => { muscle.reach = value; }));
    for (const id of ["volume", "edge_length"]) {
      on(id, "change", ({ value }) => this.muscle((muscle) => { if (value > 0) muscle[id] = Number(value); else delete muscle[id]; }));
    }
    on("fibres", "change", ({ value }) => this.muscle((muscle) => { muscle.fibres = value; }));
    number("tissue", (value) => this.point((point) => ({ ...point, tissue: value })));
    for (const axis of [0, 1]) number(`spread-${axis}`, (value) => this.spread(axis, value));
    on("normal", "change", ({ value }) => {
      const parts = value.split(",").map(Number), { list } = this.chosen;
      if (parts.length === 3 && parts.every(Number.isFinite)) this.muscle(({ curves }) => { curves[list].normal = parts; });
      else { say("A normal is three numbers: x, y, z", true); element("normal").blur(); this.fill(); }
    });
    number("own-reach", (value) => { const { list } = this.chosen; this.muscle(({ attachments }) => { attachments[list].reach = value; }); });
    on("add-point", "click", () => this.insertPoint());
    on("delete-point", "click", () => this.deletePoint());
    on("to-bone", "click", () => { const place = this.place(); this.point((point) => onBone(point, place)); });
    on("to-space", "click", () => { const place = this.place(); this.point((point) => inSpace(point, place)); });
    this.bindMuscles(on);
  }

  bindMuscles(on) {
    element("new").addEventListener("submit", (event) => {
      event.preventDefault();
      const name = element("name").value;
      if (this.state.content.muscles?.[name]) { say(`There is a muscle ${name}`, true); return; }
      this.askForCurve((curve) => {
        element("name").value = "";
        this.editor.change((content) => { (content.muscles ??= {})[name] = { curves: [curve] }; }).then(() => this.choose({ muscle: name }));
      });
    });
    on("add-curve", "click", () => this.askForCurve((curve) => this.muscle(({ curves }) => curves.push(curve))));
    on("delete-curve", "click", () => { const { list } = this.chosen; this.muscle(({ curves }) => curves.splice(list, 1)); });
    on("delete-muscle", "click", () => { const { muscle } = this.chosen; this.editor.change(({ muscles }) => { delete muscles[muscle]; }); });
    for (const end of ["origin", "insertion"]) {
      on(`add-${end}`, "click", () => this.ask({
        words: [`Click a place on a bone to which the ${end} is attached, too`],
        act: (place) => this.muscle((muscle) => (muscle.attachments ??= []).push(newAttachment(end, place))),
      }));
    }
  }

  async request(name, words) {
    await this.editor.running;
    if (name === "tets") this.pose.leave();
    say(words);
    for (const id of ["save", "tets"]) element(id).disabled = true;
    try {
      const { said } = await (await post(name)).json();
      if (name === "save") this.editor.saved = true;
      else { this.fibres = (await get("fibres")).arrays.lines; this.rebuild(); this.draw(); }
      say(said);
    } catch (error) {
      say(error.message, true);
    }
    for (const id of ["save", "tets"]) element(id).disabled = false;
  }

}

await openPage((settings, surfaces) => new Page(settings, surfaces));
