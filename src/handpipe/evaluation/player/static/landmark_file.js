/* Files of hand landmarks, as handpipe.skeleton.drivers reads them: 21 points a frame as JSON or CSV.

   JSON: {"units": "m", "handedness": "Right", "frames": [[[x, y, z], … 21 points], …]}
   CSV: frame,WRIST_x [m],WRIST_y [m],WRIST_z [m],THUMB_CMC_x [m],… */

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$/;
const UNITS = ["m", "mm", "px"];
const EXAMPLE = '{"units": "m", "handedness": "Right", "frames": [[[x, y, z], … 21 points], …]}';

/** Frames ({ name, points: [x, y, z] by landmark }) of a file, and the hand ("right", "left" or null) that it states.
    Throws an `Error` that says in one sentence where the file is wrong and what to do. */
export function readLandmarks(file, text, landmarks) {
  try {
    return file.toLowerCase().endsWith(".json") ? fromJson(text, landmarks) : fromTable(text, landmarks);
  } catch (error) {
    throw new Error(`${file}: ${error.message}.`);
  }
}

function fromJson(text, landmarks) {
  let data;
  try { data = JSON.parse(text); } catch (error) { throw new Error(`this is no JSON (${error.message}); mend the syntax`); }
  if (!Array.isArray(data?.frames) || !data.frames.length) throw new Error(`frames are missing or empty; write ${EXAMPLE}`);
  checkUnit(data.units);
  if (![undefined, null, "Right", "Left"].includes(data.handedness)) {
    throw new Error(`handedness is ${JSON.stringify(data.handedness)}; give Right or Left, or leave it out`);
  }
  const frames = data.frames.map((frame, i) => {
    const name = `frame${i + 1}`, count = Array.isArray(frame) ? frame.length : 0;
    if (count !== landmarks.length) throw new Error(`${name} has ${count} points; give ${landmarks.length}, or leave the frame out`);
    return checked(name, landmarks, frame.map((p) => (Array.isArray(p) ? p : ["x", "y", "z"].map((c) => p?.[c]))));
  });
  return { frames, hand: data.handedness ? data.handedness.toLowerCase() : null };
}

function fromTable(text, landmarks) {
  const lines = text.replace(/^\ufeff/, "").split(/\r\n|\r|\n/).map((line, i) => [i + 1, line]).filter(([, line]) => line.trim());
  if (!lines.length) throw new Error("the file is empty; give a header and a row for each frame");
  const delimiter = /^\s*"?\w+"?\s*?([,;\t])/.exec(lines[0][1])?.[1] ?? ",";
  const cells = (line) => line.split(delimiter).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1").trim());
  const header = cells(lines[0][1]), unit = / \[(.*)\]$/.exec(header[1] ?? "")?.[1];
  const wanted = ["frame", ...landmarks.flatMap((name) => ["x", "y", "z"].map((c) => `${name}_${c} [${unit ?? "mm"}]`))];
  const odd = wanted.findIndex((column, i) => header[i] !== column);
  if (odd >= 0) {
    throw new Error(`column ${odd + 1} of the header is ${JSON.stringify(header[odd] ?? "")}, not '${wanted[odd]}'; the header is ${wanted.slice(0, 4)},…`);
  }
  checkUnit(unit);
  if (lines.length < 2) throw new Error("there are no frames; give a row for each frame");
  const names = new Set();
  const frames = lines.slice(1).map(([number, line]) => {
    const row = cells(line), name = row[0], where = `row ${number} (frame ${name})`;
    if (!name || names.has(name)) throw new Error(`row ${number}: ${name ? `'${name}' names another frame already` : "the frame has no name"}; give every frame a name of its own`);
    names.add(name);
    if (row.length !== wanted.length) throw new Error(`${where} has ${row.length} cells, not ${wanted.length}; complete it`);
    const values = row.slice(1).map((cell) => numberIn(cell, delimiter !== ","));
    return { ...checked(where, landmarks, landmarks.map((_, i) => values.slice(3 * i, 3 * i + 3))), name };
  });
  return { frames, hand: null };
}

function numberIn(cell, decimalComma) {
  const text = decimalComma && !cell.includes(".") ? cell.replace(",", ".") : cell;
  return NUMBER.test(text) ? Number(text) : NaN;
}

function checkUnit(unit) {
  if (!UNITS.includes(unit)) throw new Error(`the unit is ${unit ? JSON.stringify(unit) : "missing"}; give m, mm or px`);
}

/** A frame by landmark; detectors write one point again and again for what they do not find. */
function checked(name, landmarks, points) {
  points.forEach((point, i) => {
    if (point.length !== 3 || !point.every((x) => typeof x === "number" && Number.isFinite(x))) {
      throw new Error(`${name}, ${landmarks[i]} is not three finite numbers; give x, y and z, or leave the frame out`);
    }
  });
  if (points.every((point) => point.every((x) => x === 0))) throw new Error(`${name}: all points are 0, 0, 0, no hand was found; leave the frame out`);
  const seen = new Map();
  points.forEach((point, i) => {
    const place = point.join(", "), other = seen.get(place);
    if (other !== undefined) throw new Error(`${name}: ${landmarks[other]} and ${landmarks[i]} are at one point, ${place}; leave the frame out, or give all points`);
    seen.set(place, i);
  });
  return { name, points: Object.fromEntries(landmarks.map((landmark, i) => [landmark, points[i]])) };
}
