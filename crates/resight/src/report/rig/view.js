// Built from web/src/space/view.ts by `npm run space` in web/. Do not edit.
var resightSpace = (function(exports) {
	Object.defineProperty(exports, Symbol.toStringTag, { value: "Module" });
	// src/space/view.ts
	var START = {
		yaw: .6,
		pitch: .45,
		distance: 3.2,
		shift: [0, 0]
	};
	var WAYS = {
		start: START,
		top: {
			...START,
			yaw: 0,
			pitch: Math.PI / 2
		},
		front: {
			...START,
			yaw: 0,
			pitch: 0
		},
		side: {
			...START,
			yaw: Math.PI / 2,
			pitch: 0
		}
	};
	/** Part of half of the image's shorter side that the reach fills: ellipsoids, which stand out of it by a sixth at most, fit too. */
	var FILLED = .8;
	/** Nearer than this part of the first distance nothing is drawn. */
	var NEAREST = .02;
	var ROUND = 32;
	var N_COLOURS = 7;
	var SHOWN = {
		targets: true,
		sights: false,
		ellipsoids: true,
		names: true
	};
	var NOTHING = {
		centre_m: [
			0,
			0,
			0
		],
		radius_m: 1,
		axis_m: .1,
		ellipsoid_magnification: 1,
		cameras: [],
		targets: []
	};
	var ARROWS = {
		ArrowLeft: [-1, 0],
		ArrowRight: [1, 0],
		ArrowUp: [0, -1],
		ArrowDown: [0, 1]
	};
	var limited = (x, least, greatest) => Math.min(greatest, Math.max(least, x));
	/** A view on a canvas; `colour` gives the colour of `ink`, `faint`, `c0` … `c6`, `x`, `y` and `z` as it is now. */
	function spaceView(canvas, colour) {
		let scene = NOTHING;
		let shown = SHOWN;
		let eye = { ...START };
		let isDue = false;
		function later() {
			if (isDue) return;
			isDue = true;
			requestAnimationFrame(() => {
				isDue = false;
				draw();
			});
		}
		function draw() {
			const { pen, width, height } = cleared(canvas);
			const project = projector(scene, eye, width, height);
			if (shown.targets) drawTargets(pen, project, scene, colour);
			if (shown.sights) drawSights(pen, project, scene, colour);
			drawAxes(pen, project, scene.axis_m, colour);
			drawCameras(pen, project, scene, shown, colour);
			if (shown.names) drawLabels(pen, labels(project), width, height);
		}
		function labels(project) {
			const targets = scene.targets.filter((t) => shown.targets && t.is_strong);
			return [...scene.cameras.map(({ name, position_m }) => ({
				at: project(position_m),
				text: name,
				colour: colour("ink")
			})), ...targets.map(({ name, position_m }) => ({
				at: project(position_m),
				text: name,
				colour: colour("faint")
			}))];
		}
		const view = {
			show(next, what = {}) {
				scene = next;
				shown = {
					...shown,
					...what
				};
				later();
			},
			look(way) {
				eye = {
					...WAYS[way],
					shift: [0, 0]
				};
				later();
			},
			turn(right, down) {
				eye = {
					...eye,
					yaw: eye.yaw + right,
					pitch: limited(eye.pitch + down, -Math.PI / 2, Math.PI / 2)
				};
				later();
			},
			come(factor) {
				eye = {
					...eye,
					distance: limited(eye.distance * factor, .15, 20)
				};
				later();
			},
			shift(right, down) {
				const scale = 2 * eye.distance / (FILLED * START.distance * Math.min(canvas.clientWidth, canvas.clientHeight));
				eye = {
					...eye,
					shift: [eye.shift[0] + right * scale, eye.shift[1] + down * scale]
				};
				later();
			},
			draw,
			release: () => void 0
		};
		view.release = attach(canvas, view);
		return view;
	}
	/** A canvas as sharp as the screen; lengths are those of the page. */
	function cleared(canvas) {
		const ratio = window.devicePixelRatio || 1;
		const [width, height] = [canvas.clientWidth, canvas.clientHeight];
		canvas.width = Math.max(1, Math.round(width * ratio));
		canvas.height = Math.max(1, Math.round(height * ratio));
		const pen = canvas.getContext("2d");
		pen.setTransform(ratio, 0, 0, ratio, 0, 0);
		pen.lineJoin = "round";
		pen.font = "14px system-ui, sans-serif";
		return {
			pen,
			width,
			height
		};
	}
	/** From a place in the rig to the image; null behind the eye. */
	function projector(scene, eye, width, height) {
		const [cx, cy, cz] = scene.centre_m;
		const radius = scene.radius_m;
		const away = eye.distance * radius;
		const focal = FILLED * START.distance * Math.min(width, height) / 2;
		const [sy, cyaw] = [Math.sin(eye.yaw), Math.cos(eye.yaw)];
		const [sp, cp] = [Math.sin(eye.pitch), Math.cos(eye.pitch)];
		return ([x, y, z]) => {
			const [dx, dy, dz] = [
				x - cx,
				y - cy,
				z - cz
			];
			const right = cyaw * dx + sy * dz + eye.shift[0] * radius;
			const ahead = cyaw * dz - sy * dx;
			const down = cp * dy - sp * ahead + eye.shift[1] * radius;
			const depth = cp * ahead + sp * dy + away;
			if (depth < NEAREST * START.distance * radius) return null;
			return [width / 2 + focal * right / depth, height / 2 + focal * down / depth];
		};
	}
	/** A whole line, or nothing where part of it lies behind the eye. */
	function line(pen, points, isClosed) {
		const [first] = points;
		if (!first || points.some((p) => p === null)) return;
		pen.moveTo(first[0], first[1]);
		for (const p of points.slice(1)) if (p) pen.lineTo(p[0], p[1]);
		if (isClosed) pen.closePath();
	}
	function stroke(pen, colour, width, opacity, trace) {
		pen.strokeStyle = colour;
		pen.lineWidth = width;
		pen.globalAlpha = opacity;
		pen.beginPath();
		trace();
		pen.stroke();
		pen.globalAlpha = 1;
	}
	/** Longer names are cut. */
	var MOST_LETTERS = 24;
	/** Room that a line of a name takes, px. */
	var LINE_PX = 16;
	/** Between a name and its place, px. */
	var APART_PX = 6;
	/** Names beside their places, on the first side where none lies over another or leaves the image; one that finds no side is left out. */
	function drawLabels(pen, labels, width, height) {
		const taken = [];
		for (const { at, text, colour } of labels) {
			if (at === null || text === "") continue;
			const short = text.length <= MOST_LETTERS ? text : `${text.slice(0, 23)}…`;
			const wide = pen.measureText(short).width;
			const isFree = ([x, y]) => 0 <= x && x + wide <= width && LINE_PX <= y && y <= height && taken.every(([left, right, base]) => right < x || x + wide < left || LINE_PX <= Math.abs(base - y));
			const found = [at[0] + APART_PX, at[0] - APART_PX - wide].flatMap((x) => [[x, at[1] - APART_PX], [x, at[1] + APART_PX + LINE_PX / 2]]).find(isFree);
			if (!found) continue;
			taken.push([
				found[0],
				found[0] + wide,
				found[1]
			]);
			pen.fillStyle = colour;
			pen.fillText(short, found[0], found[1]);
		}
	}
	function drawTargets(pen, project, scene, colour) {
		for (const isStrong of [false, true]) {
			const targets = scene.targets.filter((t) => t.is_strong === isStrong);
			stroke(pen, colour(isStrong ? "ink" : "faint"), isStrong ? 1.6 : .8, isStrong ? 1 : .7, () => {
				for (const t of targets) line(pen, t.outline_m.map(project), t.is_closed);
			});
			if (!isStrong) continue;
			for (const t of targets) {
				pen.fillStyle = colour("ink");
				for (const x of t.points_m) {
					const at = project(x);
					if (at) pen.fillRect(at[0] - 1.2, at[1] - 1.2, 2.4, 2.4);
				}
			}
		}
	}
	var ownColour = (camera, i) => camera.colour ?? `c${i % N_COLOURS}`;
	function drawSights(pen, project, scene, colour) {
		scene.cameras.forEach((camera, i) => {
			const from = project(camera.position_m);
			stroke(pen, colour(ownColour(camera, i)), .8, .5, () => {
				for (const t of scene.targets) if (t.seen_by.includes(i)) line(pen, [from, project(t.middle_m)], false);
			});
		});
	}
	function ring(camera, a, b, scale) {
		const [x, y, z] = camera.position_m;
		return Array.from({ length: ROUND }, (_, k) => {
			const [sin, cos] = [scale * Math.sin(2 * Math.PI * k / ROUND), scale * Math.cos(2 * Math.PI * k / ROUND)];
			return [
				x + cos * a[0] + sin * b[0],
				y + cos * a[1] + sin * b[1],
				z + cos * a[2] + sin * b[2]
			];
		});
	}
	function drawCameras(pen, project, scene, shown, colour) {
		scene.cameras.forEach((camera, i) => {
			const own = colour(ownColour(camera, i));
			const border = camera.border_m.map(project);
			const centre = project(camera.position_m);
			const step = Math.max(1, Math.floor(border.length / 4));
			stroke(pen, own, 1.6, 1, () => {
				line(pen, border, true);
				for (let k = 0; k < border.length; k += step) line(pen, [centre, border[k] ?? null], false);
			});
			if (camera.border_m.length === 0 && centre) {
				pen.fillStyle = own;
				pen.fillRect(centre[0] - 4, centre[1] - 4, 8, 8);
			}
			const [a, b, c] = camera.half_axes_m;
			if (shown.ellipsoids && a && b && c) {
				const scale = scene.ellipsoid_magnification;
				const pairs = [
					[a, b],
					[a, c],
					[b, c]
				];
				stroke(pen, own, 1, .9, () => {
					for (const [p, q] of pairs) line(pen, ring(camera, p, q, scale).map(project), true);
				});
			}
		});
	}
	function drawAxes(pen, project, length, colour) {
		const ends = [
			["x", [
				length,
				0,
				0
			]],
			["y", [
				0,
				length,
				0
			]],
			["z", [
				0,
				0,
				length
			]]
		];
		for (const [name, end] of ends) stroke(pen, colour(name), 2, 1, () => line(pen, [project([
			0,
			0,
			0
		]), project(end)], false));
	}
	/** Mouse, fingers, wheel and keys; gives what takes them off again. */
	function attach(canvas, view) {
		const fingers = /* @__PURE__ */ new Map();
		const offs = [];
		function on(kind, listener, options) {
			canvas.addEventListener(kind, listener, options);
			offs.push(() => canvas.removeEventListener(kind, listener));
		}
		on("pointerdown", (event) => {
			fingers.set(event.pointerId, [event.clientX, event.clientY]);
			canvas.setPointerCapture(event.pointerId);
			canvas.focus({ preventScroll: true });
		});
		for (const end of ["pointerup", "pointercancel"]) on(end, (event) => fingers.delete(event.pointerId));
		on("pointermove", (event) => {
			const before = fingers.get(event.pointerId);
			if (!before) return;
			const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
			const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
			fingers.set(event.pointerId, [event.clientX, event.clientY]);
			if (other) {
				const gap = (x, y) => Math.max(1, Math.hypot(x - other[0], y - other[1]));
				view.shift(dx / 2, dy / 2);
				view.come(gap(...before) / gap(event.clientX, event.clientY));
			} else if (event.shiftKey || event.buttons === 2) view.shift(dx, dy);
			else view.turn(-dx * .008, dy * .008);
		});
		on("contextmenu", (event) => event.preventDefault());
		on("wheel", (event) => {
			if (document.activeElement !== canvas) return;
			event.preventDefault();
			view.come(Math.exp(limited(event.deltaY, -200, 200) * .002));
		}, { passive: false });
		on("keydown", (event) => {
			if (event.ctrlKey || event.metaKey || event.altKey) return;
			const arrow = ARROWS[event.key];
			if (arrow && event.shiftKey) view.shift(20 * arrow[0], 20 * arrow[1]);
			else if (arrow) view.turn(-.08 * arrow[0], .08 * arrow[1]);
			else if (event.key === "+" || event.key === "=") view.come(.9);
			else if (event.key === "-") view.come(1 / .9);
			else if (event.key === "0") view.look("start");
			else return;
			event.preventDefault();
		});
		return () => offs.forEach((off) => off());
	}
	exports.spaceView = spaceView;
	return exports;
})({});
