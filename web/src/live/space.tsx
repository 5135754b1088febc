// The cameras around a target, with ellipsoids of their positions; grey is where they were by their references.
import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { AroundScene } from "../api/types";
import { spaceView, type SpaceScene, type SpaceView, type Triple, type Way } from "../space/view";
import { liveTexts as texts } from "../texts/live";
import { transport } from "../transport";
import { metres } from "./format";
import type { LiveStore } from "./store";

const AGAIN_MS = 1000;
const WAYS: Way[] = ["start", "top", "front", "side"];
const AXES = ["x", "y", "z"];
const INK: Record<string, string> = { ink: "--text", faint: "--quiet", x: "--bad", y: "--good", z: "--accent" };

export function Space({ store }: { store: LiveStore }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef<SpaceView | null>(null);
  const scenes = useSignal<AroundScene[]>([]);
  const chosen = useSignal(0);
  const scene = scenes.value[Math.min(chosen.value, scenes.value.length - 1)];
  useEffect(() => {
    const ask = () => transport.get<AroundScene[]>("/api/live/scene").then((found) => (scenes.value = found), () => {});
    void ask();
    const timer = setInterval(ask, AGAIN_MS);
    return () => clearInterval(timer);
  }, []);
  useEffect(() => {
    if (!scene || !canvas.current) return;
    view.current ??= spaceView(canvas.current, colour);
    view.current.show(drawn(scene));
  }, [scene]);
  useEffect(() => () => view.current?.release(), []);
  if (!scene) return <p class="nothing">{texts.spaceNothing}</p>;
  return (
    <div class="live-space" data-live={store.isNow.value}>
      <div class="row">
        {1 < scenes.value.length && (
          <label class="row">{texts.spaceTarget}
            <select value={chosen.value} onChange={(event) => (chosen.value = Number(event.currentTarget.value))}>
              {scenes.value.map((one, i) => <option key={one.target} value={i}>{one.target}</option>)}
            </select>
          </label>
        )}
        {WAYS.map((way) => <button key={way} onClick={() => view.current?.look(way)}>{texts.spaceWays[way]}</button>)}
      </div>
      <canvas ref={canvas} tabIndex={0} role="application" aria-label={texts.spaceLabel} />
      <p class="small quiet">{texts.spaceEllipsoids(String(scene.ellipsoid_magnification))}</p>
      <table class="places">
        <thead>
          <tr><th scope="col">{texts.spaceCamera}</th>{AXES.map((axis) => <th key={axis} scope="col" class="number">{axis}</th>)}</tr>
        </thead>
        <tbody>
          {scene.cameras.filter((camera) => !camera.is_reference).map((camera) => (
            <tr key={camera.name}>
              <th scope="row">{camera.name}</th>
              {camera.position_m.map((x, i) => <td key={i} class="number" data-axis={AXES[i]}>{metres(x, camera.sigma_m[i]!)}</td>)}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

const CAMERA_INKS = ["--accent", "--good", "--warn", "--bad"];

function colour(name: string): string {
  const property = INK[name] ?? CAMERA_INKS[Number(name.slice(1)) % CAMERA_INKS.length]!;
  return getComputedStyle(document.documentElement).getPropertyValue(property).trim();
}

/** As the view draws it: each camera keeps its colour, and its reference is grey and has no name. */
function drawn(scene: AroundScene): SpaceScene {
  const names = [...new Set(scene.cameras.map((camera) => camera.name))];
  const cameras = scene.cameras.map((camera) => ({
    name: camera.is_reference ? "" : camera.name,
    position_m: camera.position_m as unknown as Triple,
    border_m: camera.border_m as unknown as Triple[],
    half_axes_m: camera.half_axes_m as unknown as Triple[],
    colour: camera.is_reference ? "faint" : `c${names.indexOf(camera.name)}`,
  }));
  const target = {
    name: scene.target,
    position_m: [0, 0, 0] as Triple,
    outline_m: scene.outline_m as unknown as Triple[],
    is_closed: true,
    points_m: scene.points_m as unknown as Triple[],
    middle_m: scene.centre_m as unknown as Triple,
    seen_by: [],
    is_strong: true,
  };
  return {
    centre_m: scene.centre_m as unknown as Triple,
    radius_m: scene.radius_m,
    axis_m: scene.axis_m,
    ellipsoid_magnification: scene.ellipsoid_magnification,
    cameras,
    targets: [target],
  };
}
