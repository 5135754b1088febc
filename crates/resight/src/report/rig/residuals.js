// Every residual over its camera's image. A point: u and v in 1/32767 of the image area (u's top bit: left out), residual in steps.
const stored = (() => {
  const text = atob(data.residuals);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new DataView(bytes.buffer);
})();
const fields = [...document.querySelectorAll("canvas[data-camera]")];
const observations = data.cameras.map(() => []);
for (let i = 0, first = 0; i < data.observations.length; i += 4) {
  const [camera, view, , count] = data.observations.slice(i, i + 4);
  observations[camera].push({ view, first, count });
  first += count;
}
const LONGEST_LEFT_OUT = 0.1; // of the width: magnified, they would cover everything else
let magnification = data.residual_magnification;

// Calls back with place (0 to 1), residual (in units of the image) and whether the point was left out.
function eachPoint(camera, visit) {
  const { step } = data.cameras[camera];
  for (const { view, first, count } of observations[camera]) {
    if (!isLookedAt(view)) continue;
    for (let at = 8 * first; at < 8 * (first + count); at += 8) {
      const u = stored.getUint16(at, true);
      const place = [(u & 0x7fff) / 32767, stored.getUint16(at + 2, true) / 32767];
      visit(place, [stored.getInt16(at + 4, true) * step, stored.getInt16(at + 6, true) * step], u >> 15 === 1);
    }
  }
}

function drawField(canvas) {
  const camera = Number(canvas.dataset.camera);
  const [u0, v0, u1, v1] = data.cameras[camera].area;
  canvas.style.aspectRatio = u1 - u0 + "/" + (v1 - v0);
  const { pen, width, height } = cleared(canvas);
  const scale = [width / (u1 - u0), height / (v1 - v0)];
  const paths = [new Path2D(), new Path2D()];
  const counts = [0, 0];
  const longest = width * LONGEST_LEFT_OUT;
  eachPoint(camera, (place, residual, isLeftOut) => {
    const kind = Number(isLeftOut);
    const [x, y] = [place[0] * width, place[1] * height];
    const arrow = [residual[0] * magnification * scale[0], residual[1] * magnification * scale[1]];
    const cut = isLeftOut ? Math.min(1, longest / Math.max(1e-9, Math.hypot(...arrow))) : 1;
    counts[kind] += 1;
    paths[kind].moveTo(x, y);
    paths[kind].lineTo(x + cut * arrow[0], y + cut * arrow[1]);
  });
  const isCrowded = counts[0] > 3000;
  pen.lineWidth = isCrowded ? 0.6 : 1.2;
  pen.globalAlpha = isCrowded ? 0.45 : 0.9;
  pen.strokeStyle = colorOf(camera);
  pen.stroke(paths[0]);
  if (byId("left-out").checked) {
    pen.globalAlpha = 0.9;
    pen.setLineDash([3, 2]);
    pen.strokeStyle = style("--lost");
    pen.stroke(paths[1]);
    pen.setLineDash([]);
  }
  pen.globalAlpha = 1;
  sayField(canvas, camera, counts);
}

function sayField(canvas, camera, counts) {
  const { name, unit } = data.cameras[camera];
  const view = state.view === ALL_VIEWS ? "all views" : "view " + data.views[state.view];
  const lost = counts[1] ? ", " + counts[1] + " left out (dashed, cut at a tenth of the width)" : "";
  const drawn = counts[0] + " points used" + lost;
  const caption = canvas.parentElement.querySelector("figcaption");
  caption.textContent = name + ", " + view + ": " + drawn + "; residuals in " + unit + " magnified " + magnification + "\u00a0×";
  canvas.setAttribute("aria-label", caption.textContent);
}

drawings.push(() => fields.forEach(drawField));
