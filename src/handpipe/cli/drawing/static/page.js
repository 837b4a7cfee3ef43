"use strict";

const LOOK = -1; // no pen: dragging moves the crosshair
const ERASER = 0;
const element = (name) => document.getElementById(name);
let viewer, settings;
let saved = true;

function say(text, wrong = false) {
  element("said").textContent = text;
  element("said").classList.toggle("wrong", wrong);
}

async function post(name, body) {
  const response = await fetch(name, { method: "POST", body });
  const { said } = await response.json();
  if (!response.ok) throw new Error(said);
  return said;
}

/** Colours by value, 0 to 255, as the viewer wants them; a value without a name is red. */
function colourTable() {
  const names = Array.from({ length: 256 }, (_, value) => (value ? String(value) : ""));
  const table = { R: [], G: [], B: [], A: [], I: [], labels: names };
  for (let value = 0; value < 256; value++) {
    table.I.push(value);
    table.R.push(value ? 255 : 0);
    table.G.push(0);
    table.B.push(0);
    table.A.push(value ? 255 : 0);
  }
  for (const [name, value] of Object.entries(settings.pens)) {
    [table.R[value], table.G[value], table.B[value]] = settings.colours[name];
    names[value] = name;
  }
  return table;
}

function choose(value, button) {
  for (const other of element("pens").querySelectorAll("button")) other.classList.toggle("chosen", other === button);
  viewer.opts.drawingEnabled = value !== LOOK;
  if (value !== LOOK) viewer.setPenValue(value, false);
}

function addPen(name, value, colour) {
  const button = document.createElement("button");
  const square = document.createElement("i");
  square.style.background = colour ? `rgb(${colour.join(",")})` : "transparent";
  button.append(square, name);
  button.dataset.value = value;
  if (settings.file !== null) button.onclick = () => choose(value, button);
  element("pens").append(button);
  return button;
}

function addPens() {
  const drawing = settings.file !== null;
  const look = drawing ? addPen("look", LOOK) : null;
  if (drawing) addPen("eraser", ERASER);
  for (const [name, value] of Object.entries(settings.pens)) addPen(name, value, settings.colours[name]);
  if (look) choose(LOOK, look);
}

async function showDrawing() {
  const given = new Uint8Array(await (await fetch("drawing")).arrayBuffer());
  viewer.setDrawColormap(colourTable());
  viewer.setDrawingEnabled(true);
  if (viewer.drawBitmap.length !== given.length) throw new Error("The viewer has another number of voxels");
  viewer.drawBitmap.set(given);
  viewer.drawClearAllUndoBitmaps();
  viewer.drawAddUndoBitmap();
  viewer.refreshDrawing(true);
  viewer.opts.drawingEnabled = false;
}

async function save() {
  try {
    say(await post("save", viewer.drawBitmap));
    saved = true;
  } catch (error) {
    say(error.message, true);
  }
}

async function end() {
  if (!saved && !confirm("End without saving?")) return;
  saved = true;
  await post("stop");
  say("Ended. This page can be closed.");
  element("end").disabled = element("save").disabled = true;
}

function connect() {
  const views = { multi: "sliceTypeMultiplanar", axial: "sliceTypeAxial", coronal: "sliceTypeCoronal", sagittal: "sliceTypeSagittal" };
  element("save").onclick = save;
  element("undo").onclick = () => viewer.drawUndo();
  element("end").onclick = end;
  element("view").onchange = (event) => viewer.setSliceType(viewer[views[event.target.value]]);
  element("opacity").oninput = (event) => viewer.setDrawOpacity(event.target.value / 100);
  element("size").oninput = (event) => {
    viewer.opts.penSize = Number(event.target.value);
    element("voxels").textContent = event.target.value === "1" ? "1 voxel" : `${event.target.value} voxels`;
  };
  viewer.onDrawingChanged = () => { saved = settings.file === null; };
  window.addEventListener("beforeunload", (event) => { if (!saved) event.preventDefault(); });
  window.addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === "z") viewer.drawUndo();
  });
  if (settings.file === null) for (const name of ["tools", "sizes"]) element(name).hidden = true;
}

async function start() {
  settings = await (await fetch("settings.json")).json();
  element("title").textContent = document.title = settings.title;
  viewer = new niivue.Niivue({ backColor: [0.086, 0.094, 0.114, 1], crosshairWidth: 0.3, dragAndDropEnabled: false,
    isNearestInterpolation: true, maxDrawUndoBitmaps: 32 });
  await viewer.attachTo("canvas");
  await viewer.loadVolumes([{ url: "volume.nii", name: "volume.nii" }]);
  connect();
  await showDrawing();
  viewer.setDrawOpacity(0.7);
  addPens();
  saved = true;
  say(settings.file === null ? "" : `Save writes ${settings.file}`);
  document.body.dataset.ready = "yes";
}

start().catch((error) => say(error.message, true));
