// All cameras, those with an alarm in front.
import { computed, useSignal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import type { CameraView } from "../api/types";
import { Note, Status } from "../parts/status";
import { liveTexts as texts } from "../texts/live";
import { Arrow, forget } from "./arrow";
import { angle, clock, duration, length, milliseconds, rate, size, timed } from "./format";
import { ShotCanvas } from "./shot";
import type { LiveStore } from "./store";

export function Grid({ store }: { store: LiveStore }) {
  return (
    <div class="cameras" data-few={store.cameras.value.length <= 2}>
      {store.cameras.value.map((camera) => <Tile key={camera.name} camera={camera} store={store} />)}
    </div>
  );
}

function Tile({ camera, store }: { camera: CameraView; store: LiveStore }) {
  const { name } = camera;
  const shot = useMemo(() => computed(() => store.shots.value[name]), [store, name]);
  const isLive = store.isLive(camera);
  return (
    <article class="tile" data-camera={name} data-state={camera.state ?? "none"} data-live={isLive} data-alarm={!!camera.alarm} aria-label={name}>
      <header class="row tight">
        <h2 class="cut grow" title={name}>{name}</h2>
        <State camera={camera} isLive={isLive} />
      </header>
      <button class="shot" onClick={() => store.choose(name)}>
        <span class="visually-hidden">{texts.show(name)}</span>
        <ShotCanvas shot={shot} name={name} />
        {!shot.value && <span class="no-picture">{texts.noPicture}</span>}
        {!isLive && <NotLive camera={camera} />}
      </button>
      {camera.alarm && <Alarm camera={camera} store={store} />}
      <WayBack camera={camera} isLive={isLive} />
      <Figures camera={camera} isLive={isLive} />
    </article>
  );
}

/** The state; what is not of now is never shown as if it were. */
export function State({ camera, isLive }: { camera: CameraView; isLive: boolean }) {
  if (!camera.state) return <Status word="stale" text={texts.waiting} />;
  return isLive ? <Status word={camera.state} /> : <Status word="stale" text={texts.notLive} />;
}

export function NotLive({ camera }: { camera: CameraView }) {
  return (
    <span class="hatch">
      <span class="label">
        {texts.notLive}
        {camera.age_s != null && ` · ${texts.age(duration(camera.age_s))}`}
      </span>
    </span>
  );
}

export function Alarm({ camera, store }: { camera: CameraView; store: LiveStore }) {
  const fault = useSignal("");
  const { alarm, name } = camera;
  if (!alarm) return null;
  const acknowledge = () => store.acknowledge(name).catch((problem: Error) => (fault.value = problem.message));
  return (
    <div class="alarm row tight" role="alert">
      <span class="grow"><strong>{texts.alarmSince(clock(alarm.unix_s))}</strong></span>
      <button class="main" aria-label={texts.acknowledgeName(name)} onClick={acknowledge}>{texts.acknowledge}</button>
      {fault.value && <Note tone="bad" live>{fault.value}</Note>}
    </div>
  );
}

/** What puts it back, or why it is not known how it is. */
export function WayBack({ camera, isLive }: { camera: CameraView; isLive: boolean }) {
  const { way_back: back, name } = camera;
  if (!back) forget(name + true), forget(name + false);
  if (!isLive) return <p class="back quiet">{camera.lost ? `${texts.lost} ${camera.lost}` : camera.has_ended ? texts.ended : timed(camera.words)}</p>;
  if (!back) return <p class="back quiet">{timed(camera.words)}</p>;
  return (
    <div class="back row tight">
      <Arrow camera={name} back={back} />
      <p class="grow"><span class="quiet">{texts.putBack}</span> <strong>{back.words}</strong></p>
    </div>
  );
}

function Figures({ camera, isLive }: { camera: CameraView; isLive: boolean }) {
  const latency = camera.stages.find((stage) => stage.name === "latency")?.median_us ?? null;
  const { pose } = camera;
  return (
    <dl class="figures">
      <div>
        <dt>{texts.sigma}</dt>
        <dd>{pose && isLive ? `${angle(size(pose.rotation_sigma_rad))}, ${length(size(pose.sigma_m))}` : "–"}</dd>
      </div>
      <div><dt>{texts.fps}</dt><dd>{isLive ? rate(camera.fps) : "0"}</dd></div>
      <div><dt>{texts.latency}</dt><dd>{isLive ? milliseconds(latency) : "–"}</dd></div>
    </dl>
  );
}
