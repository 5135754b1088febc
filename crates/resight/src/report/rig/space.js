// The image in space: what the page knows, as the view draws it. The view is that of `resight serve` (view.js, built from web/src/space).
const AXES = { x: "#d22", y: "#2a8f2a", z: "#46f" };
const space = resightSpace.spaceView(byId("space"), (name) => AXES[name] || style("--" + name));
const look = (way) => space.look(way);

const cameras = data.cameras.map((camera) => {
  const rigFromCam = poseAt(camera.rig_from_cam, 0);
  const border_m = triples(camera.border).map(([x, y, z]) => moved(rigFromCam, x * data.depth_m, y * data.depth_m, z * data.depth_m));
  return { name: camera.name, position_m: rigFromCam.t, border_m, half_axes_m: triples(camera.axes) };
});
const targets = data.targets.map(({ name, points, outline }) => {
  const all = triples(points);
  const middle = [0, 1, 2].map((i) => all.reduce((sum, x) => sum + x[i], 0) / Math.max(1, all.length));
  return { name, points: all, outline: outline.length ? outline.map((i) => all[i]) : all, is_closed: outline.length > 0, middle };
});
const seenBy = new Map(); // "view,target" → cameras
for (let i = 0; i < data.observations.length; i += 4) {
  const key = data.observations[i + 1] + "," + data.observations[i + 2];
  if (!seenBy.has(key)) seenBy.set(key, []);
  seenBy.get(key).push(data.observations[i]);
}

// Placed targets of the view that is looked at.
function placedNow() {
  const isOne = state.view !== ALL_VIEWS;
  const placed = [];
  for (let i = 0; i < data.placed.length; i += 9) {
    const [view, number] = [data.placed[i], data.placed[i + 1]];
    if (!isLookedAt(view)) continue;
    const [target, pose] = [targets[number], poseAt(data.placed, i + 2)];
    const put = (x) => moved(pose, x[0], x[1], x[2]);
    placed.push({
      name: target.name,
      position_m: pose.t,
      outline_m: target.outline.map(put),
      is_closed: target.is_closed,
      points_m: isOne ? target.points.map(put) : [],
      middle_m: put(target.middle),
      seen_by: seenBy.get(view + "," + number) || [],
      is_strong: isOne,
    });
  }
  return placed;
}

const scene = { view: null, targets: [] };
const isShown = (what) => byId("show-" + what).checked;

drawings.push(() => {
  if (scene.view !== state.view) Object.assign(scene, { view: state.view, targets: placedNow() });
  space.show(
    {
      centre_m: data.extent.slice(0, 3),
      radius_m: data.extent[3],
      axis_m: data.depth_m,
      ellipsoid_magnification: data.ellipse_magnification,
      cameras,
      targets: scene.targets,
    },
    { targets: isShown("targets"), sights: isShown("sights"), ellipsoids: isShown("ellipsoids"), names: isShown("names") },
  );
});
