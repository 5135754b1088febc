// A capture of intrinsics: the newest image with the points found, what is covered and the next view; what is known and what is missing.
import { computed, useSignal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { CaptureStateObject, CaptureView, IntrinsicParameterObject } from "../api/types";
import { Confirm } from "../parts/dialog";
import { Figure } from "../parts/figure";
import type { Picture } from "../parts/picture";
import { Sheet } from "../parts/sheet";
import { Note, Status } from "../parts/status";
import { colours } from "../parts/theme";
import { ViewportState, toScreen } from "../parts/transform";
import { Viewport } from "../parts/viewport";
import { fixed } from "../results/format";
import { captureTexts as texts } from "../texts/capture";
import { common, sentence } from "../texts/common";
import type { CaptureStore } from "./capture-store";
import { outline } from "./shot";

export function Capture({ store }: { store: CaptureStore }) {
  const view = store.view.value;
  if (!view) return <div class="nothing" role="status"><p>{texts.connecting}</p></div>;
  return (
    <div class="split one capture" data-ended={view.is_over} data-n-kept={view.state.views.length}>
      <div class="stage">
        <header class="row tight">
          <h1 class="cut grow" title={view.source}>{view.source}</h1>
          <Status word={view.state.status} />
        </header>
        <Large store={store} view={view} />
        <Newest state={view.state} />
      </div>
      <Sheet label={texts.title} summary={<span class="cut small">{texts.views}: {texts.viewsOf(view.state.views.length, view.state.progress.needed_views)}</span>}>
        <Verdict store={store} view={view} />
        <Known state={view.state} />
        <Views store={store} view={view} />
      </Sheet>
    </div>
  );
}

function Large({ store, view }: { store: CaptureStore; view: CaptureView }) {
  const viewport = useMemo(() => new ViewportState(), []);
  const picture: ReadonlySignal<Picture | null> = useMemo(() => computed(() => {
    const now = store.shot.value;
    return now ? { width: now.width_px, height: now.height_px, levels: [now.bitmap], turns: 0 as const } : null;
  }), [store]);
  const size = view.state.size_px?.join(" × ");
  useEffect(() => {
    if (view.state.size_px) viewport.show(...view.state.size_px);
  }, [size]);
  const { found, covered, next } = texts.legend;
  return (
    <div class="large">
      <Viewport state={viewport} picture={picture} label={texts.picture} layers={[(pen, at) => drawn(pen, at, store)]}>
        {!store.shot.value && <span class="no-picture">{texts.noPicture}</span>}
      </Viewport>
      <ul class="legend small" aria-hidden="true">
        <li data-of="found">{found}</li>
        <li data-of="covered">{covered}</li>
        <li data-of="next">{next}</li>
      </ul>
    </div>
  );
}

function drawn(pen: CanvasRenderingContext2D, at: ViewportState, store: CaptureStore) {
  const [state, shot] = [store.view.value?.state, store.shot.value];
  if (!state?.size_px) return;
  const place = (x: readonly [number, number]) => toScreen(at.transform.value, x) as [number, number];
  cells(pen, state, place);
  if (state.next_view && !store.view.value?.is_over) {
    pen.setLineDash([8, 5]);
    const closed = [...state.next_view.outline_px, ...state.next_view.outline_px.slice(0, 1)];
    outline(pen, [closed], place, colours.value.warn, 2.5);
    pen.setLineDash([]);
  }
  pen.strokeStyle = pen.fillStyle = colours.value.accent;
  pen.lineWidth = 2;
  for (const point of shot?.points_px ?? []) {
    pen.beginPath();
    pen.arc(...place(point), 3.5, 0, 2 * Math.PI);
    pen.stroke();
  }
}

/** Cells with a corner in a kept view. */
function cells(pen: CanvasRenderingContext2D, { coverage, size_px }: CaptureStateObject, place: (x: readonly [number, number]) => [number, number]) {
  if (!coverage || !size_px) return;
  const [w, h] = [size_px[0] / coverage.columns, size_px[1] / coverage.rows];
  pen.fillStyle = pen.strokeStyle = colours.value.good;
  pen.lineWidth = 1;
  coverage.counts.forEach((n, i) => {
    if (!n) return;
    const [u, v] = [(i % coverage.columns) * w - 0.5, Math.floor(i / coverage.columns) * h - 0.5];
    const [[left, top], [right, bottom]] = [place([u, v]), place([u + w, v + h])];
    pen.globalAlpha = 0.22;
    pen.fillRect(left, top, right - left, bottom - top);
    pen.globalAlpha = 0.7;
    pen.strokeRect(left + 0.5, top + 0.5, right - left - 1, bottom - top - 1);
  });
  pen.globalAlpha = 1;
}

/** What became of the newest image, and the next view: beside the picture, for whoever moves the target looks there. */
function Newest({ state }: { state: CaptureStateObject }) {
  const { last, next_view: next } = state;
  return (
    <div class="newest" aria-live="polite">
      {last && <p data-kept={last.view !== null} class="last"><span class="quiet">{texts.newest}:</span> <strong>{sentence(last.message)}</strong></p>}
      {next && <p class="next-view"><span class="quiet">{texts.next}:</span> {sentence(next.message)}</p>}
    </div>
  );
}

function Verdict({ store, view }: { store: CaptureStore; view: CaptureView }) {
  const { state } = view;
  return (
    <section class="step" id="verdict">
      {!view.is_over && !store.isConnected.value && <Note tone="bad" live>{texts.gone}</Note>}
      {view.failed && <Note tone="bad" live>{texts.failed} {sentence(view.failed)}</Note>}
      {view.is_over && !view.failed && <Note tone={view.is_written ? "good" : "bad"} live>{view.is_written ? texts.written(view.output) : texts.notWritten}</Note>}
      <p><strong>{sentence(state.message)}</strong></p>
      {state.missing.length > 0 && <h2>{texts.missing}</h2>}
      <ul class="missing">{state.missing.map((one) => <li key={one}>{sentence(one)}</li>)}</ul>
      {view.source_ended && !view.is_over && <Note tone="warn" live>{texts.sourceEnded} {sentence(view.source_ended)}</Note>}
      {state.remarks.map((remark) => <Note key={remark} tone="warn">{sentence(remark.replace(/^warning: /, ""))}</Note>)}
      {!view.is_over && <Finish store={store} view={view} />}
    </section>
  );
}

function Finish({ store, view }: { store: CaptureStore; view: CaptureView }) {
  const fault = useSignal("");
  const isAsked = useSignal(false);
  const asks = useSignal(false);
  const { state, output } = view;
  const finish = async () => {
    asks.value = false;
    isAsked.value = true;
    await store.finish().catch((problem: Error) => (fault.value = problem.message));
    isAsked.value = false;
  };
  return (
    <>
      <button class="main" disabled={!state.is_usable || isAsked.value} onClick={() => (state.progress.is_enough ? void finish() : (asks.value = true))}>
        {isAsked.value ? texts.finishing : texts.finish}
      </button>
      <p class="quiet small">{state.is_usable ? texts.finishWhat(output) : texts.finishNot}</p>
      {fault.value && <Note tone="bad" live>{fault.value}</Note>}
      {asks.value && (
        <Confirm title={texts.finishEarlyTitle} yes={texts.finish} no={common.cancel} onYes={() => void finish()} onClose={() => (asks.value = false)}>
          <ul class="missing">{state.missing.map((one) => <li key={one}>{sentence(one)}</li>)}</ul>
          <p>{texts.finishEarly(output)}</p>
        </Confirm>
      )}
    </>
  );
}

const percent = (share: number) => `${(100 * share).toFixed(0)} %`;
const px = (value: number | null) => (value == null ? "–" : `${value.toFixed(2)} px`);
const within = ({ value, sigma }: IntrinsicParameterObject, digits: number) => `${fixed(value, digits)} ± ${fixed(sigma, digits)}`;

/** Coefficients with as many digits as their ± warrants. */
function parameter(one: IntrinsicParameterObject): string {
  if (!one.name.endsWith("_px")) return within(one, one.sigma > 0 ? Math.max(0, Math.min(6, 1 - Math.floor(Math.log10(one.sigma)))) : 3);
  return `${within(one, one.sigma < 0.1 ? 2 : 1)} px`;
}

function Known({ state }: { state: CaptureStateObject }) {
  const { parameters, progress } = state;
  return (
    <section class="step" id="known">
      <header><h2>{texts.known}</h2>{state.model && <span class="cut">{state.model}</span>}</header>
      {parameters ? parameters.filter((one) => one.estimated).map((one) => (
        <Figure key={one.name} name={one.name} title={texts.parameters[one.name] ?? one.name} words={parameter(one)} />
      )) : <p class="quiet">{texts.unknown}</p>}
      <Figure name="worst" title={`${texts.worst} (${texts.needed(px(progress.needed_px))})`} help={texts.worstHelp} link="capture.md" words={px(progress.worst_px)} />
      <Figure name="coverage" title={`${texts.coverage} (${texts.needed(percent(progress.needed_coverage))})`} help={texts.coverageHelp} link="capture.md" words={percent(state.coverage?.share ?? 0)} />
    </section>
  );
}

function Views({ store, view }: { store: CaptureStore; view: CaptureView }) {
  const fault = useSignal("");
  const { views, progress, refused } = view.state;
  const last = views.at(-1);
  const takeBack = async (name: string) => {
    fault.value = "";
    await store.takeBack(name).catch((problem: Error) => (fault.value = problem.message));
  };
  return (
    <section class="step" id="views">
      <header><h2>{texts.views}</h2><span class="cut">{texts.viewsOf(views.length, progress.needed_views)}</span></header>
      {last && !view.is_over && <button onClick={() => void takeBack(last.view)}>{texts.takeBack(last.view)}</button>}
      {fault.value && <Note tone="bad" live>{fault.value}</Note>}
      {!last && <p class="quiet">{texts.viewsNone}</p>}
      {last && (
        <div class="wide" tabIndex={0} role="group" aria-label={texts.views}>
          <table>
            <thead><tr><th scope="col">{texts.columns.view}</th><th scope="col" class="number">{texts.columns.focal}</th><th scope="col" class="number">{texts.columns.worst}</th></tr></thead>
            <tbody>
              {[...views].reverse().map((one) => (
                <tr key={one.view}>
                  <th scope="row" title={one.frame}>{one.view}</th>
                  <td class="number">{px(one.parameters?.[0]?.sigma ?? null)}</td>
                  <td class="number">{px(one.worst_px)}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {refused.length > 0 && <h3>{texts.refused}</h3>}
      <ul class="refused small">{refused.map(({ reason, n }) => <li key={reason}>{texts.reasons[reason] ?? reason}: {n}</li>)}</ul>
    </section>
  );
}
