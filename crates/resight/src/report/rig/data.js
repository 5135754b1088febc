// What the page knows, the one view that is looked at, and small helpers. Names reach the page only as text.
const byId = (id) => document.getElementById(id);
const data = JSON.parse(byId("rig-data").textContent);
const ALL_VIEWS = -1;
const state = { view: ALL_VIEWS };
const drawings = [];
let isDue = false;

// Draws everything once before the next image is shown, however often it was asked for.
function redraw() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    for (const draw of drawings) draw();
  });
}

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const N_COLORS = 7;
const colorOf = (camera) => style("--c" + (camera % N_COLORS));

// A cleared canvas as sharp as the screen; lengths are those of the page.
function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.lineJoin = "round";
  pen.font = "13px system-ui, sans-serif";
  return { pen, width, height };
}

// Rotation matrix, row by row, of a unit quaternion w, x, y, z.
function rotationOf(w, x, y, z) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
}

// From seven numbers (quaternion, translation) at an index of a list.
function poseAt(list, at) {
  return { r: rotationOf(list[at], list[at + 1], list[at + 2], list[at + 3]), t: list.slice(at + 4, at + 7) };
}

function moved({ r, t }, x, y, z) {
  return [
    r[0] * x + r[1] * y + r[2] * z + t[0],
    r[3] * x + r[4] * y + r[5] * z + t[1],
    r[6] * x + r[7] * y + r[8] * z + t[2],
  ];
}

// Triples of a flat list.
function triples(list) {
  const points = [];
  for (let i = 0; i + 2 < list.length; i += 3) points.push([list[i], list[i + 1], list[i + 2]]);
  return points;
}

const isLookedAt = (view) => state.view === ALL_VIEWS || state.view === view;
