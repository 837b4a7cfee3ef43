/* What the pages of curves and of bones share: fields, sentences, sides to look from, the skin, a pointer's clicks. */

import * as THREE from "three";
import { looks, meshesOf } from "space";
import { get, post } from "./editor.js";

const VIEWS = { front: [0, 0, 1, 0, 1, 0], back: [0, 0, -1, 0, 1, 0], right: [0, 1, 0, 0, 0, 1], left: [0, -1, 0, 0, 0, 1], end: [1, 0, 0, 0, 0, 1] };
const STILL = 4; // pixels that a pointer may move in a click
export const SKIN = [0.9, 0.72, 0.62];
export const BONE = [0.93, 0.9, 0.82];

export const element = (id) => document.getElementById(id);

/** Shows a value in a field, unless a person is writing there. */
export function put(id, value) { if (document.activeElement !== element(id)) element(id).value = value; }

export function say(text, wrong = false) {
  element("said").textContent = text;
  element("said").classList.toggle("wrong", wrong);
}

export function geometryOf(arrays, name) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(arrays[`${name}/vertices`], 3));
  geometry.setIndex(new THREE.BufferAttribute(arrays[`${name}/triangles`], 1));
  geometry.computeVertexNormals();
  return geometry;
}

/** The skin's meshes, and the sphere around it. */
export function skinOf(arrays) {
  const geometry = geometryOf(arrays, "skin");
  geometry.computeBoundingSphere();
  return { meshes: meshesOf(geometry, looks(null, { colour: SKIN, opacity: 0.15 }), 1000), sphere: geometry.boundingSphere };
}

/** Opens a page, which `make` makes of its settings and surfaces, with the state of its session. */
export async function openPage(make) {
  try {
    const settings = await (await fetch("settings.json")).json();
    element("title").textContent = document.title = settings.title;
    const page = make(settings, await get("surfaces"));
    document.querySelector("main").page = page;
    addViews(page.space, page.sphere);
    page.editor.start(await get("state"));
    say(`Save writes ${settings.file}`);
    document.body.dataset.ready = "yes";
  } catch (error) {
    say(`${error.message}. The page needs WebGL 2 and a browser from 2023 or later.`, true);
    throw error;
  }
}

/** Ends the server, and with it what the page can do. */
export async function endPage(editor) {
  if (editor.saved === false && !confirm("End without saving?")) return;
  editor.saved = true;
  await post("stop");
  say("Ended. This page can be closed.");
  for (const button of document.querySelectorAll("aside button")) button.disabled = true;
}

/** Buttons of the sides to look from. */
function addViews(space, sphere) {
  for (const [view, side] of Object.entries(VIEWS)) {
    element("views").append(Object.assign(document.createElement("button"), { textContent: view, onclick: () => space.look(side, sphere) }));
  }
  space.look(VIEWS.front, sphere);
}

/** The slider of the skin's opacity. */
export function listenToSkin(meshes, draw) {
  element("skin").addEventListener("input", ({ target: { value } }) => {
    for (const mesh of meshes) mesh.visible = value > 0;
    meshes.at(-1).material.opacity = Number(value);
    draw();
  });
}

/** Ctrl-Z and Ctrl-Shift-Z, Escape, and leaving a page that is not saved. */
export function listenToKeys(editor, { escape, remove }) {
  window.addEventListener("keydown", (e) => {
    if (["INPUT", "SELECT"].includes(e.target.tagName)) return;
    if ((e.ctrlKey || e.metaKey) && e.key.toLowerCase() === "z") { e.preventDefault(); editor[e.shiftKey ? "redo" : "undo"](); }
    if (e.key === "Delete") remove();
    if (e.key === "Escape") escape();
  });
  window.addEventListener("beforeunload", (e) => { if (editor.saved === false) e.preventDefault(); });
}

export const isStill = (pressed, event) => pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < STILL;

/** Where a canvas shows a place, in pixels of the page. */
export function pixelsOf(canvas, camera, place) {
  const box = canvas.getBoundingClientRect(), { x, y } = place.clone().project(camera);
  return [box.left + (x + 1) / 2 * box.width, box.top + (1 - y) / 2 * box.height];
}

/** The texts as items of a list. */
export function list(id, texts) {
  element(id).replaceChildren(...texts.map((textContent) => Object.assign(document.createElement("li"), { textContent })));
}
