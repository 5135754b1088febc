// The image in space: the eye circles a centre; the formula is that of the still image.
const space = byId("space");
const START = { yaw: data.eye[0], pitch: data.eye[1], distance: data.eye[2], shift: [0, 0] };
const TURNS = {
  start: START,
  top: { ...START, yaw: 0, pitch: Math.PI / 2 },
  front: { ...START, yaw: 0, pitch: 0 },
  side: { ...START, yaw: Math.PI / 2, pitch: 0 },
};
let eye = { ...START };
const FILLED = 1.3;
const NEAREST = 0.02;
const ROUND = 32;

const cameras = data.cameras.map((camera) => {
  const rigFromCam = poseAt(camera.rig_from_cam, 0);
  const border = triples(camera.border).map(([x, y, z]) => moved(rigFromCam, x * data.depth_m, y * data.depth_m, z * data.depth_m));
  return { name: camera.name, place: rigFromCam.t, border, axes: triples(camera.axes) };
});
const targets = data.targets.map(({ name, points, outline }) => {
  const all = triples(points);
  const middle = [0, 1, 2].map((i) => all.reduce((sum, x) => sum + x[i], 0) / Math.max(1, all.length));
  return { name, points: all, outline, middle };
});
const placed = [];
for (let i = 0; i < data.placed.length; i += 9) {
  placed.push({ view: data.placed[i], target: data.placed[i + 1], rigFromTarget: poseAt(data.placed, i + 2) });
}
const observationsOf = new Map(); // "view,target" → cameras
for (let i = 0; i < data.observations.length; i += 4) {
  const key = data.observations[i + 1] + "," + data.observations[i + 2];
  if (!observationsOf.has(key)) observationsOf.set(key, []);
  observationsOf.get(key).push(data.observations[i]);
}

// From a place in the rig to the image; null behind the eye.
function projector(width, height) {
  const [cx, cy, cz, radius] = data.extent;
  const away = eye.distance * radius;
  const focal = (FILLED * START.distance * height) / 2;
  const [sy, cyaw] = [Math.sin(eye.yaw), Math.cos(eye.yaw)];
  const [sp, cp] = [Math.sin(eye.pitch), Math.cos(eye.pitch)];
  return ([x, y, z]) => {
    const [dx, dy, dz] = [x - cx, y - cy, z - cz];
    const right = cyaw * dx + sy * dz + eye.shift[0] * radius;
    const ahead = cyaw * dz - sy * dx;
    const down = cp * dy - sp * ahead + eye.shift[1] * radius;
    const depth = cp * ahead + sp * dy + away;
    if (depth < NEAREST * START.distance * radius) return null;
    return [width / 2 + (focal * right) / depth, height / 2 + (focal * down) / depth];
  };
}

function line(pen, points, isClosed) {
  if (points.some((p) => p === null) || points.length === 0) return;
  pen.moveTo(points[0][0], points[0][1]);
  for (let i = 1; i < points.length; i++) pen.lineTo(points[i][0], points[i][1]);
  if (isClosed) pen.closePath();
}

function stroke(pen, color, width, opacity, trace) {
  pen.strokeStyle = color;
  pen.lineWidth = width;
  pen.globalAlpha = opacity;
  pen.beginPath();
  trace();
  pen.stroke();
  pen.globalAlpha = 1;
}

function label(pen, at, text, color) {
  if (at === null) return;
  pen.fillStyle = color;
  pen.fillText(text, at[0] + 6, at[1] - 6);
}

const isShown = (what) => byId("show-" + what).checked;

function drawTargets(pen, project) {
  const shown = placed.filter((p) => isLookedAt(p.view));
  const isOne = state.view !== ALL_VIEWS;
  const faint = style("--faint");
  const place = (p, x) => project(moved(p.rigFromTarget, x[0], x[1], x[2]));
  stroke(pen, isOne ? style("--ink") : faint, isOne ? 1.6 : 0.8, isOne ? 1 : 0.7, () => {
    for (const p of shown) {
      const { points, outline } = targets[p.target];
      const corners = outline.length ? outline.map((i) => points[i]) : points;
      line(pen, corners.map((x) => place(p, x)), outline.length > 0);
    }
  });
  if (!isOne) return;
  for (const p of shown) {
    pen.fillStyle = style("--ink");
    for (const x of targets[p.target].points) {
      const at = place(p, x);
      if (at) pen.fillRect(at[0] - 1.2, at[1] - 1.2, 2.4, 2.4);
    }
    if (isShown("names")) label(pen, project(p.rigFromTarget.t), targets[p.target].name, faint);
  }
}

function drawSights(pen, project) {
  const shown = placed.filter((p) => isLookedAt(p.view));
  cameras.forEach((camera, i) => {
    const from = project(camera.place);
    stroke(pen, colorOf(i), 0.8, 0.5, () => {
      for (const p of shown) {
        const seeing = observationsOf.get(p.view + "," + p.target) || [];
        if (seeing.includes(i)) line(pen, [from, project(moved(p.rigFromTarget, ...targets[p.target].middle))], false);
      }
    });
  });
}

function ring(camera, a, b) {
  const scale = data.ellipse_magnification;
  const points = [];
  for (let k = 0; k < ROUND; k++) {
    const [sin, cos] = [Math.sin((2 * Math.PI * k) / ROUND), Math.cos((2 * Math.PI * k) / ROUND)];
    points.push(camera.place.map((x, i) => x + scale * (cos * camera.axes[a][i] + sin * camera.axes[b][i])));
  }
  return points;
}

function drawCameras(pen, project) {
  cameras.forEach((camera, i) => {
    const color = colorOf(i);
    const border = camera.border.map(project);
    const centre = project(camera.place);
    const step = Math.max(1, Math.floor(border.length / 4));
    stroke(pen, color, 1.6, 1, () => {
      line(pen, border, true);
      for (let k = 0; k < border.length; k += step) line(pen, [centre, border[k]], false);
    });
    if (isShown("ellipsoids")) {
      stroke(pen, color, 1, 0.9, () => {
        for (const [a, b] of [[0, 1], [0, 2], [1, 2]]) line(pen, ring(camera, a, b).map(project), true);
      });
    }
    if (isShown("names")) label(pen, centre, camera.name, style("--ink"));
  });
}

function drawAxes(pen, project) {
  const length = data.depth_m;
  for (const [color, end] of [["#d22", [length, 0, 0]], ["#2a8f2a", [0, length, 0]], ["#46f", [0, 0, length]]]) {
    stroke(pen, color, 2, 1, () => line(pen, [project([0, 0, 0]), project(end)], false));
  }
}

drawings.push(() => {
  const { pen, width, height } = cleared(space);
  const project = projector(width, height);
  if (isShown("targets")) drawTargets(pen, project);
  if (isShown("sights")) drawSights(pen, project);
  drawAxes(pen, project);
  drawCameras(pen, project);
});

const limited = (x, least, greatest) => Math.min(greatest, Math.max(least, x));

function turn(right, down) {
  eye.yaw += right;
  eye.pitch = limited(eye.pitch + down, -Math.PI / 2, Math.PI / 2);
  redraw();
}

function come(factor) {
  eye.distance = limited(eye.distance * factor, 0.15, 20);
  redraw();
}

// By pixels of the page: what lies at the centre follows the finger.
function shift(right, down) {
  const scale = (2 * eye.distance) / (FILLED * START.distance * space.clientHeight);
  eye.shift = [eye.shift[0] + right * scale, eye.shift[1] + down * scale];
  redraw();
}

function look(way) {
  eye = { ...TURNS[way], shift: [0, 0] };
  redraw();
}

const fingers = new Map();
space.addEventListener("pointerdown", (event) => {
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  space.setPointerCapture(event.pointerId);
  space.focus({ preventScroll: true });
});
for (const end of ["pointerup", "pointercancel"]) space.addEventListener(end, (event) => fingers.delete(event.pointerId));
space.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
  const other = [...fingers].find(([id]) => id !== event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  if (other) {
    const gap = (x, y) => Math.max(1, Math.hypot(x - other[1][0], y - other[1][1]));
    shift(dx / 2, dy / 2);
    come(gap(...before) / gap(event.clientX, event.clientY));
  } else if (event.shiftKey || event.buttons === 2) {
    shift(dx, dy);
  } else {
    turn(-dx * 0.008, dy * 0.008);
  }
});
space.addEventListener("contextmenu", (event) => event.preventDefault());
space.addEventListener("wheel", (event) => {
  if (document.activeElement !== space) return; // Scrolling past must not zoom.
  event.preventDefault();
  come(Math.exp(limited(event.deltaY, -200, 200) * 0.002));
}, { passive: false });

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
space.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const arrow = ARROWS[event.key];
  if (arrow && event.shiftKey) shift(20 * arrow[0], 20 * arrow[1]);
  else if (arrow) turn(-0.08 * arrow[0], 0.08 * arrow[1]);
  else if (event.key === "+" || event.key === "=") come(0.9);
  else if (event.key === "-") come(1 / 0.9);
  else if (event.key === "0") look("start");
  else return;
  event.preventDefault();
});
