"use strict";

const NEAR = 12; // pixels of the screen from a mark at which a pointer takes it
const STILL = 4; // pixels that a pointer moves in a click, at most
const ENOUGH = 16; // points, as the command asks for
const RULER = ["ruler 1", "ruler 2"];
const element = (name) => document.getElementById(name);
const far = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

let settings, picture;
let saved = true;
const marks = new Map(); // place in pixels of the picture by name
const history = []; // what was before each change: name and place, if it had one
let next; // name of the point that is asked for
let shift = [0, 0], zoom = 1; // pixels of the screen: of the picture's corner, and of one of its pixels

function say(text, wrong = false) {
  element("said").textContent = text;
  element("said").classList.toggle("wrong", wrong);
}

async function post(name, body = "") {
  const response = await fetch(name, { method: "POST", body });
  const { said } = await response.json();
  if (!response.ok) throw new Error(said);
  return said;
}

const names = () => [...RULER, ...settings.drawing.points.map((point) => point.name)];

function words(name) {
  if (RULER.includes(name)) return `known length: ${name === RULER[0] ? "one end" : "the other end"}`;
  return settings.drawing.points.find((point) => point.name === name).words;
}

/** What the command reads. */
function marked() {
  const points = Object.fromEntries([...marks].filter(([name]) => !RULER.includes(name)));
  const found = { points, hand: element("hand").value, view: element("view").value };
  if (RULER.every((name) => marks.has(name))) found.ruler = RULER.map((name) => marks.get(name));
  if (Number(element("distance").value) > 0) found.distance = Number(element("distance").value);
  return found;
}

function ask(name) {
  next = name;
  const count = names().filter((other) => !RULER.includes(other) && marks.has(other)).length;
  element("asked").textContent = name ? `Mark the ${words(name)}` : `All is marked: ${count} points`;
  for (const button of element("points").querySelectorAll("button")) {
    button.classList.toggle("next", button.value === name);
    button.classList.toggle("done", marks.has(button.value));
    if (button.value === name) element("points").scrollTop = button.offsetTop - element("points").clientHeight / 2;
  }
  element("undo").disabled = history.length === 0;
  element("skip").disabled = !name;
  draw();
}

/** The first point after `name` that has no mark. */
function after(name) {
  const all = names(), at = all.indexOf(name) + 1;
  return [...all.slice(at), ...all.slice(0, at)].find((other) => !marks.has(other));
}

function put(name, place) {
  history.push([name, marks.get(name)]);
  marks.set(name, place);
  changed();
}

function changed() {
  saved = false;
  element("link").hidden = true;
}

function undo() {
  const last = history.pop();
  if (!last) return;
  const [name, place] = last;
  if (place) marks.set(name, place);
  else marks.delete(name);
  changed();
  ask(place ? next : name);
}

/* The picture: places on the screen and in its pixels. */

const onScreen = (place) => [shift[0] + zoom * place[0], shift[1] + zoom * place[1]];
const inPicture = (at) => [(at[0] - shift[0]) / zoom, (at[1] - shift[1]) / zoom];

function fit() {
  const canvas = element("picture"), { clientWidth: w, clientHeight: h } = canvas;
  const before = [canvas.width, canvas.height];
  canvas.width = w;
  canvas.height = h;
  return before[0] !== w || before[1] !== h;
}

function whole() {
  fit();
  const { width: w, height: h } = element("picture");
  zoom = Math.min(w / picture.naturalWidth, h / picture.naturalHeight);
  shift = [(w - zoom * picture.naturalWidth) / 2, (h - zoom * picture.naturalHeight) / 2];
  draw();
}

function draw() {
  const canvas = element("picture"), c = canvas.getContext("2d");
  c.setTransform(1, 0, 0, 1, 0, 0);
  c.clearRect(0, 0, canvas.width, canvas.height);
  c.setTransform(zoom, 0, 0, zoom, ...shift);
  c.imageSmoothingEnabled = zoom < 2;
  c.drawImage(picture, 0, 0);
  c.setTransform(1, 0, 0, 1, 0, 0);
  const ends = RULER.map((name) => marks.get(name)).filter(Boolean).map(onScreen);
  if (ends.length === 2) line(c, ends, "#d08700");
  c.font = "12px system-ui, sans-serif";
  for (const [name, place] of marks) {
    const [x, y] = onScreen(place);
    dot(c, [x, y], 5, RULER.includes(name) ? "#d08700" : "#0b5c8a");
    c.lineWidth = 3;
    c.strokeStyle = "#fff";
    c.strokeText(name, x + 8, y - 6);
    c.fillStyle = "#1d2733";
    c.fillText(name, x + 8, y - 6);
  }
  drawWhere();
}

function dot(c, [x, y], radius, colour) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.fillStyle = colour;
  c.fill();
  c.lineWidth = 1.5;
  c.strokeStyle = "#fff";
  c.stroke();
}

function line(c, [a, b], colour) {
  c.beginPath();
  c.moveTo(...a);
  c.lineTo(...b);
  c.lineWidth = 2;
  c.strokeStyle = colour;
  c.stroke();
}

/* The drawing of the template: where the point lies. */

function drawWhere() {
  const canvas = element("drawing"), c = canvas.getContext("2d"), { skin, bones, points } = settings.drawing;
  const flip = (element("hand").value === "left") !== (element("view").value === "palm") ? -1 : 1;
  const xs = skin.flatMap((t) => [t[0], t[2], t[4]]), ys = skin.flatMap((t) => [t[1], t[3], t[5]]);
  const low = [Math.min(...xs), Math.min(...ys)], high = [Math.max(...xs), Math.max(...ys)];
  const scale = 0.94 * Math.min(canvas.width / (high[0] - low[0]), canvas.height / (high[1] - low[1]));
  const at = (x, y) => [
    canvas.width / 2 + flip * scale * (x - (low[0] + high[0]) / 2), canvas.height / 2 + scale * (y - (low[1] + high[1]) / 2),
  ];
  c.clearRect(0, 0, canvas.width, canvas.height);
  for (const [triangles, colour] of [[skin, "#ecc9a8"], [bones, "#f7efdf"]]) {
    c.beginPath();
    for (const t of triangles) {
      c.moveTo(...at(t[0], t[1]));
      c.lineTo(...at(t[2], t[3]));
      c.lineTo(...at(t[4], t[5]));
      c.closePath();
    }
    c.fillStyle = c.strokeStyle = colour;
    c.lineWidth = 1;
    c.fill();
    c.stroke();
  }
  for (const point of points) {
    const place = at(...point.at), here = point.name === next;
    dot(c, place, here ? 7 : 3, here ? "#b3261e" : marks.has(point.name) ? "#0b5c8a" : "#8a949e");
    if (here) {
      c.beginPath();
      c.arc(...place, 14, 0, 2 * Math.PI);
      c.lineWidth = 2;
      c.strokeStyle = "#b3261e";
      c.stroke();
    }
  }
}

/* The pointer: a click marks, a mark is dragged, else the picture is shifted. */

function listen() {
  const canvas = element("picture");
  let held;
  const at = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  canvas.addEventListener("pointerdown", (event) => {
    const start = at(event);
    const [name] = [...marks].map(([key, place]) => [key, far(onScreen(place), start)]).filter(([, d]) => d < NEAR).sort((a, b) => a[1] - b[1])[0] ?? [];
    held = { name, start, last: start, moved: false, before: marks.get(name) };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    const now = at(event);
    held.moved ||= far(now, held.start) > STILL;
    if (held.moved && held.name) marks.set(held.name, inPicture(now));
    else if (held.moved) shift = [shift[0] + now[0] - held.last[0], shift[1] + now[1] - held.last[1]];
    held.last = held.moved ? now : held.last;
    draw();
  });
  canvas.addEventListener("pointerup", (event) => {
    if (!held) return;
    const { name, moved, before } = held;
    held = undefined;
    if (moved && name) {
      history.push([name, before]);
      changed();
      ask(next);
    } else if (!moved && name) ask(name);
    else if (!moved && next) {
      const place = inPicture(at(event));
      if (place.some((x) => x < 0) || place[0] > picture.naturalWidth || place[1] > picture.naturalHeight) return;
      put(next, place);
      ask(after(next));
    }
  });
  canvas.addEventListener("pointercancel", () => { held = undefined; });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const here = at(event), place = inPicture(here);
    zoom *= 1.0015 ** -event.deltaY;
    shift = [here[0] - zoom * place[0], here[1] - zoom * place[1]];
    draw();
  }, { passive: false });
  window.addEventListener("resize", () => { if (fit()) draw(); });
  window.addEventListener("beforeunload", (event) => { if (!saved) event.preventDefault(); });
  window.addEventListener("keydown", (event) => { if ((event.ctrlKey || event.metaKey) && event.key === "z") undo(); });
}

/** Whether the command would take what is marked; else says why not. */
function complete() {
  const { points, ruler, distance } = marked(), count = Object.keys(points).length;
  if (!ruler || !distance) say("Mark both ends of a known length, and give it in mm.", true);
  else if (count < ENOUGH) say(`${count} points are marked; the hand needs ${ENOUGH} or more.`, true);
  else return true;
  return false;
}

async function send(name) {
  try {
    const said = await post(name, JSON.stringify(marked()));
    saved = true;
    say(said);
    element("link").hidden = name !== "make";
  } catch (error) {
    say(error.message, true);
  }
}

async function make() {
  if (!complete()) return;
  say("Making the hand: about ten seconds.");
  element("make").disabled = true;
  await send("make");
  element("make").disabled = false;
}

async function end() {
  if (!saved && !confirm("End without saving?")) return;
  saved = true;
  await post("stop");
  say("Ended. This page can be closed.");
  for (const name of ["save", "make", "end"]) element(name).disabled = true;
}

function connect() {
  element("undo").onclick = undo;
  element("skip").onclick = () => ask(after(next) === next ? undefined : after(next));
  element("whole").onclick = whole;
  element("save").onclick = () => send("save");
  element("make").onclick = make;
  element("end").onclick = end;
  for (const name of ["hand", "view", "distance"]) element(name).addEventListener("input", () => { changed(); draw(); });
  for (const name of names()) {
    const item = document.createElement("li"), button = document.createElement("button");
    Object.assign(button, { type: "button", value: name, textContent: words(name), onclick: () => ask(name) });
    item.append(button);
    element("points").append(item);
  }
}

/** Marks of an earlier page. */
function restore({ points = {}, ruler, distance, hand, view }) {
  for (const [name, place] of Object.entries(points)) if (names().includes(name)) marks.set(name, place);
  if (ruler) RULER.forEach((name, i) => marks.set(name, ruler[i]));
  if (distance) element("distance").value = distance;
  if (hand) element("hand").value = hand;
  if (view) element("view").value = view;
}

async function start() {
  settings = await (await fetch("settings.json")).json();
  element("title").textContent = document.title = settings.title;
  element("hand").value = settings.hand;
  element("view").value = settings.view;
  picture = new Image();
  picture.src = "picture";
  await picture.decode();
  connect();
  listen();
  restore(settings.marked ?? {});
  whole();
  ask(names().find((name) => !marks.has(name)));
  say(`The points are saved to ${settings.file}`);
  document.body.dataset.ready = "yes";
}

start().catch((error) => say(error.message, true));
