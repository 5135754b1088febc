// Step 3: the pose and what it means.
import { useSignal } from "@preact/signals";
import { Figure } from "../../parts/figure";
import { Note, Status, toneOf } from "../../parts/status";
import { sentence } from "../../texts/common";
import { photographTexts as texts } from "../../texts/photograph";
import { apply, showsBirdseye, view, viewport } from "../store";
import { Step } from "./step";

const t = texts.answer;
/** Shown at once; the rest are details. */
const FIRST = ["height", "tilt", "distance"];

export function AnswerStep() {
  const now = view.value!;
  const answer = now.answer;
  const details = useSignal(false);
  if (!answer) return <Step n={3} name="answer" done={false}><p class="quiet small">{t.none}</p></Step>;
  const shown = details.value ? now.figures : now.figures.filter((figure) => FIRST.includes(figure.name));
  return (
    <Step n={3} name="answer" done={!now.is_old && answer.status === "ok"}>
      <div class="row">
        <Status word={answer.status} />
        {now.is_old && <Status word="old" text={t.old} />}
      </div>
      <Note tone={now.is_old ? "grey" : toneOf(answer.status)} live>{sentence(answer.message)}</Note>
      <div class="answer-figures" data-old={now.is_old}>
        {shown.map((figure) => <Figure key={figure.name} {...figure} />)}
      </div>
      {details.value && <Details />}
      <div class="row">
        <span class="quiet small grow">{t.help}</span>
        <button class="plain" aria-expanded={details.value} onClick={() => (details.value = !details.value)}>{t.details} <span aria-hidden="true">{details.value ? "▴" : "▾"}</span></button>
      </div>
      {now.advice && (
        <div class="advice">
          <p class="small">{now.advice.words}</p>
          <button onClick={() => viewport.reveal([now.advice!.u_px, now.advice!.v_px], 120)}>{t.advice}</button>
        </div>
      )}
      <div class="row">
        <label class="check"><input type="checkbox" checked={now.show.grid} onChange={(event) => apply({ kind: "show", grid: event.currentTarget.checked, axes: now.show.axes })} />{now.overlay ? t.grid(metres(now.overlay.grid_spacing_m)) : t.grid("–")}</label>
        <label class="check"><input type="checkbox" checked={now.show.axes} onChange={(event) => apply({ kind: "show", grid: now.show.grid, axes: event.currentTarget.checked })} />{t.axes}</label>
        <button aria-pressed={showsBirdseye.value} disabled={!now.birdseye && !showsBirdseye.value} onClick={() => (showsBirdseye.value = !showsBirdseye.value)}>{t.view}</button>
      </div>
    </Step>
  );
}

/** `50 cm`, `2 m` */
export function metres(length_m: number): string {
  const cm = Number((100 * length_m).toPrecision(3));
  return length_m < 1 ? `${cm} cm` : `${Number(length_m.toPrecision(3))} m`;
}

function Details() {
  const answer = view.value!.answer!;
  const rows: [string, string | null][] = [
    [t.points, String(answer.n_points)],
    [t.rms, answer.rms_px == null ? null : `${answer.rms_px.toFixed(2)} px`],
    [t.probability, answer.probability == null ? null : `${(100 * answer.probability).toFixed(answer.probability < 0.9995 ? 1 : 2)} %`],
  ];
  return (
    <>
      {rows.filter(([, value]) => value).map(([title, value]) => <div key={title} class="figure"><span class="title">{title}</span><span class="value">{value}</span><span /></div>)}
      {answer.remarks?.map((remark) => <p key={remark} class="small quiet">{sentence(remark)}</p>)}
    </>
  );
}
