// One camera at full size: picture with target and residuals, what puts it back, its numbers, reference, history and log.
import { computed, useSignal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { CameraView, ReferenceView } from "../api/types";
import { Confirm } from "../parts/dialog";
import { Figure, PlusMinus } from "../parts/figure";
import type { Picture } from "../parts/picture";
import { Sheet } from "../parts/sheet";
import { Note } from "../parts/status";
import { colours } from "../parts/theme";
import { ViewportState, toScreen } from "../parts/transform";
import { Viewport } from "../parts/viewport";
import { common } from "../texts/common";
import { liveTexts as texts } from "../texts/live";
import { transport } from "../transport";
import { angle, clock, degrees, length, metres, milliseconds, timed } from "./format";
import { Alarm, NotLive, State, WayBack } from "./grid";
import { Comparison } from "./reference";
import { outline } from "./shot";
import type { LiveStore, Shot } from "./store";
import { Strip } from "./strip";

const RESIDUAL_SCREEN_PX = 18;

export function Camera({ camera, store }: { camera: CameraView; store: LiveStore }) {
  const isLive = store.isLive(camera);
  useEffect(() => {
    const escape = (event: KeyboardEvent) => event.key === "Escape" && !document.querySelector("dialog[open]") && store.choose(null);
    addEventListener("keydown", escape);
    return () => removeEventListener("keydown", escape);
  }, [store]);
  return (
    <div class="split one" data-camera={camera.name} data-live={isLive}>
      <div class="stage">
        <header class="row tight">
          <button onClick={() => store.choose(null)} aria-label={texts.back}>←</button>
          <h1 class="cut grow" title={camera.name}>{camera.name}</h1>
          <State camera={camera} isLive={isLive} />
        </header>
        <Large camera={camera} store={store} isLive={isLive} />
        <Strip camera={camera.name} store={store} />
      </div>
      <Sheet label={camera.name}>
        <section class="step">
          {camera.alarm && <Alarm camera={camera} store={store} />}
          <WayBack camera={camera} isLive={isLive} />
          {isLive && camera.way_back && <p class="small">{timed(camera.words)}</p>}
        </section>
        <Numbers camera={camera} isLive={isLive} store={store} />
        <Reference camera={camera} store={store} />
        <Log camera={camera.name} store={store} />
      </Sheet>
    </div>
  );
}

function Large({ camera, store, isLive }: { camera: CameraView; store: LiveStore; isLive: boolean }) {
  const { name } = camera;
  const state = useMemo(() => new ViewportState(), [name]);
  const shot = useMemo(() => computed(() => store.shots.value[name]), [store, name]);
  const picture: ReadonlySignal<Picture | null> = useMemo(() => computed(() => {
    const now = shot.value;
    return now ? { width: now.width_px, height: now.height_px, levels: [now.bitmap], turns: 0 as const } : null;
  }), [shot]);
  const size = shot.value && `${shot.value.width_px} × ${shot.value.height_px}`;
  useEffect(() => {
    if (shot.value) state.show(shot.value.width_px, shot.value.height_px);
  }, [size]);
  const times = magnification(shot.value);
  return (
    <div class="large">
      <Viewport state={state} picture={picture} label={texts.picture(name)} layers={[(pen, at) => drawn(pen, at, shot.value, times)]}>
        {!shot.value && <span class="no-picture">{texts.noPictureLive}</span>}
        {!isLive && <NotLive camera={camera} />}
      </Viewport>
      {shot.value?.points?.length ? <p class="caption small">{texts.overlay}, {texts.residualScale(times)}</p> : null}
    </div>
  );
}

/** 1, 2 or 5 times a power of ten: the largest residual becomes about as long as a fingertip is wide. */
function magnification(shot: Shot | undefined): number {
  const largest = Math.max(0, ...(shot?.points ?? []).map(([, , du, dv]) => Math.hypot(du, dv)));
  if (!largest) return 1;
  const wanted = RESIDUAL_SCREEN_PX / largest;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const lead = wanted / power;
  return Math.max(1, power * (lead < 2 ? 1 : lead < 5 ? 2 : 5));
}

function drawn(pen: CanvasRenderingContext2D, state: ViewportState, shot: Shot | undefined, times: number) {
  if (!shot) return;
  const place = (x: readonly [number, number]) => toScreen(state.transform.value, x) as [number, number];
  outline(pen, shot.outline, place, colours.value.accent, 2);
  for (const [u, v, du, dv, agrees] of shot.points ?? []) {
    const [x, y] = place([u, v]);
    pen.strokeStyle = pen.fillStyle = agrees ? colours.value.good : colours.value.bad;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(x, y, agrees ? 3 : 5, 0, 2 * Math.PI);
    pen.stroke();
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + times * du, y + times * dv);
    pen.stroke();
  }
}

function Numbers({ camera, isLive, store }: { camera: CameraView; isLive: boolean; store: LiveStore }) {
  const { pose, spread, ambiguity } = camera;
  const words = texts.figures;
  return (
    <>
      <section class="step" data-live={isLive}>
        <header><h2>{texts.sections.pose}</h2>{camera.target && <span class="cut">{camera.target}</span>}</header>
        {pose ? (
          <>
            <Triple names={texts.axes.xyz} title={words.distance} help={words.distanceHelp} all={pose.position_m.map((x, i) => metres(x, pose.sigma_m[i]!))} />
            <Triple names={texts.axes.angles} title={words.angles} help={words.anglesHelp} all={pose.yaw_pitch_roll_rad.map((x, i) => degrees(x, pose.rotation_sigma_rad[[1, 0, 2][i]!]!))} />
            <Figure title={words.rms} help={words.rmsHelp} link="reading-the-answer.md" words={camera.rms_px == null ? "–" : `${camera.rms_px.toFixed(3)} px`} />
            <Figure title={words.agree} help={words.agreeHelp} words={`${camera.n_agree ?? 0} / ${camera.n_points}`} name="agree" />
            {ambiguity && <Figure title={words.ambiguity} help={words.ambiguityHelp} link="reading-the-answer.md" words={ambiguity.is_ambiguous ? texts.ambiguous((100 * ambiguity.probability).toFixed(0)) : texts.unique} name="ambiguity" />}
          </>
        ) : <p class="quiet">{camera.no_pose ?? texts.waiting}</p>}
      </section>
      <section class="step" data-live={isLive}>
        <header>
          <h2>{texts.sections.noise}</h2>
          <span class="grow" />
          <button onClick={() => void store.reset(camera.name)}>{texts.reset}</button>
        </header>
        <p class="small quiet" data-figure="spread-n">{texts.spreadOf(spread.n)}</p>
        <Triple names={texts.axes.xyz} title={words.spreadRotation} help={words.spreadRotationHelp} all={spread.rotation_rad?.map(angle) ?? ["–"]} />
        <Triple names={texts.axes.xyz} title={words.spreadPosition} help={words.spreadPositionHelp} all={spread.translation_m?.map(length) ?? ["–"]} />
      </section>
      <section class="step" data-live={isLive}>
        <header><h2>{texts.sections.stages}</h2></header>
        <table>
          <thead><tr><th scope="col">{texts.latency}</th><th scope="col" class="number">{texts.median}</th><th scope="col" class="number">{texts.p99}</th></tr></thead>
          <tbody>
            {camera.stages.map((stage) => (
              <tr key={stage.name}>
                <th scope="row">{texts.stages[stage.name]}</th>
                <td class="number">{milliseconds(stage.median_us)}</td>
                <td class="number">{milliseconds(stage.p99_us)}</td>
              </tr>
            ))}
          </tbody>
        </table>
        <Figure title={texts.dropped} words={String(camera.dropped)} name="dropped" />
        <Figure title={texts.leftOut} words={String(camera.left_out)} />
      </section>
    </>
  );
}

/** Three numbers under each other, each with the name of its axis. */
function Triple({ title, help, all, names }: { title: string; help: string; all: string[]; names: string[] }) {
  const named = all.length === 1 ? all : all.map((words, i) => `${names[i]} ${words}`);
  return (
    <div class="triple">
      <Figure title={title} help={help} words={named[0]!} />
      {named.slice(1).map((words, i) => <p key={i} class="value"><PlusMinus words={words} /></p>)}
    </div>
  );
}

/** What the camera is compared with, and setting another one. */
function Reference({ camera, store }: { camera: CameraView; store: LiveStore }) {
  const all = useSignal<ReferenceView[]>([]);
  const asks = useSignal(false);
  const said = useSignal<{ tone: "good" | "bad"; text: string } | null>(null);
  const { name } = camera;
  useEffect(() => {
    const ask = () => transport.get<ReferenceView[]>("/api/live/reference", { camera: name }).then((found) => (all.value = found), () => {});
    void ask();
    const timer = setInterval(ask, 1000);
    return () => clearInterval(timer);
  }, [name]);
  const set = async () => {
    asks.value = false;
    try {
      await store.setReference(name);
      said.value = { tone: "good", text: texts.setReferenceAsked };
    } catch (fault) {
      said.value = { tone: "bad", text: (fault as Error).message };
    }
  };
  const { fixed } = store.view.value!;
  return (
    <section class="step" id="reference">
      <header><h2>{texts.sections.reference}</h2></header>
      {all.value.map((one) => <Comparison key={one.target} reference={one} pose={camera.target === one.target ? camera.pose : null} />)}
      {fixed ? <p class="quiet small">{fixed}</p> : <button onClick={() => (asks.value = true)}>{texts.setReference}</button>}
      {said.value && <Note tone={said.value.tone} live>{said.value.text}</Note>}
      {asks.value && (
        <Confirm title={texts.setReferenceTitle(name)} yes={texts.setReferenceYes} no={common.cancel} onYes={() => void set()} onClose={() => (asks.value = false)}>
          {all.value.map((one) => <Comparison key={one.target} reference={one} pose={camera.target === one.target ? camera.pose : null} />)}
          <p>{texts.setReferenceWhat}</p>
        </Confirm>
      )}
    </section>
  );
}

function Log({ camera, store }: { camera: string; store: LiveStore }) {
  const lines = store.log.value.filter((line) => line.camera === camera || line.camera == null).reverse();
  return (
    <section class="step">
      <header><h2>{texts.sections.log}</h2></header>
      {lines.length === 0 && <p class="quiet">{texts.logNothing}</p>}
      <ol class="log small" tabIndex={0} aria-label={texts.sections.log}>
        {lines.map((line, i) => <li key={lines.length - i}><time>{clock(line.unix_s)}</time> {timed(line.text)}</li>)}
      </ol>
    </section>
  );
}
