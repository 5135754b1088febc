// The tab Live: all cameras, one of them at full size, all of them in space, or their points.
import "./live.css";
import { useSignal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { Note } from "../parts/status";
import { liveTexts as texts } from "../texts/live";
import { Camera } from "./camera";
import { Capture } from "./capture";
import { CaptureStore } from "./capture-store";
import { Grid } from "./grid";
import { PointTable } from "./points";
import { Space } from "./space";
import { transport } from "../transport";
import { LiveStore } from "./store";

/** What the program does: it watches cameras, or calibrates one. */
export function Live() {
  const [capture, set] = useState<CaptureStore | null | undefined>(undefined);
  useEffect(() => {
    let made: CaptureStore | null = null;
    let isClosed = false;
    const found = (is: boolean) => {
      if (isClosed) return;
      made = is ? new CaptureStore() : null;
      set(made);
    };
    transport.capture().then((view) => found(view !== null), () => found(false));
    return () => {
      isClosed = true;
      made?.close();
    };
  }, []);
  if (capture === undefined) return null;
  return capture ? <Capture store={capture} /> : <Watched />;
}

function Watched() {
  const [store, set] = useState<LiveStore | null>(null);
  useEffect(() => {
    const made = new LiveStore();
    set(made);
    return () => made.close();
  }, []);
  if (!store) return null;
  const { link, view } = store;
  if (link.value === "no session") return <NoSession store={store} />;
  if (!view.value) return <div class="nothing" role="status"><p>{link.value === "gone" ? texts.gone : texts.connecting}</p></div>;
  return <Session store={store} />;
}

function NoSession({ store }: { store: LiveStore }) {
  const fault = useSignal("");
  const isStarting = useSignal(false);
  const start = async () => {
    isStarting.value = true;
    await store.example().catch((problem: Error) => (fault.value = problem.message));
    isStarting.value = false;
  };
  return (
    <div class="nothing">
      <h1>{texts.noSession}</h1>
      <button class="main" disabled={isStarting.value} onClick={start}>{isStarting.value ? texts.connecting : texts.example}</button>
      <p class="quiet small">{texts.exampleWhat}</p>
      {fault.value && <Note tone="bad" live>{fault.value}</Note>}
      <p>{texts.noSessionHow}</p>
      <p><code>{texts.noSessionCommand}</code></p>
      <p class="quiet">{texts.noSessionMake}</p>
      <p><code>{texts.noSessionServe}</code></p>
      <p class="quiet">{texts.noSessionCapture}</p>
      <p><code>{texts.noSessionCaptureCommand}</code></p>
    </div>
  );
}

type Shown = "cameras" | "space" | "points";
const SHOWN: Shown[] = ["cameras", "space", "points"];
const NAMES: Record<Shown, string> = { cameras: texts.cameras, space: texts.space, points: texts.points };

function Session({ store }: { store: LiveStore }) {
  const shown = useSignal<Shown>("cameras");
  const chosen = store.view.value!.cameras.find((camera) => camera.name === store.chosen.value);
  if (chosen) return <><Notices store={store} /><Camera key={chosen.name} camera={chosen} store={store} /></>;
  return (
    <div class="live">
      <h1 class="visually-hidden">{texts.title}</h1>
      <Notices store={store} />
      <div class="row live-views" role="group" aria-label={texts.title}>
        {SHOWN.map((name) => (
          <button key={name} aria-pressed={shown.value === name} onClick={() => (shown.value = name)}>{NAMES[name]}</button>
        ))}
      </div>
      {shown.value === "cameras" && <Grid store={store} />}
      {shown.value === "space" && <Space store={store} />}
      {shown.value === "points" && <PointTable store={store} />}
    </div>
  );
}

/** Why what is shown may not be so. */
function Notices({ store }: { store: LiveStore }) {
  const { failed, is_over: isOver } = store.view.value!;
  return (
    <div class="notices">
      {!store.isNow.value && store.link.value !== "connecting" && <Note tone="bad" live>{texts.gone}</Note>}
      {failed ? <Note tone="bad" live>{texts.failed} {failed}</Note> : isOver && <Note tone="grey" live>{texts.over}</Note>}
    </div>
  );
}
