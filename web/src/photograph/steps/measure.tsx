// Step 4: what is measured, as a table that sorts, is copied and is downloaded.
import { useSignal } from "@preact/signals";
import type { MeasuredKind, MeasurementView } from "../../api/types";
import { download } from "../../parts/files";
import { photographTexts as texts } from "../../texts/photograph";
import { addMeasured, apply, failed, isMeasured, measurements, pending, photo, selected, session, showPhoto, tool, view } from "../store";
import { transport } from "../../transport";
import { Step } from "./step";

const t = texts.measure;
const KINDS: MeasuredKind[] = ["length", "polyline", "area", "height", "position"];
type Column = "name" | "what" | "value";

export function MeasureStep() {
  const now = view.value!;
  const can = !!now.answer && now.figures.length > 0;
  const kind = isMeasured(tool.value) ? tool.value : null;
  return (
    <Step n={4} name="measure" done={0 < now.measurements.length} summary={now.measurements.length || undefined}>
      <div class="row kinds" role="group" aria-label={t.choose}>
        {KINDS.map((what) => (
          <button key={what} aria-pressed={kind === what} disabled={!can} onClick={() => {
            pending.value = [];
            tool.value = kind === what ? "marks" : what;
          }}>{texts.kinds[what]}</button>
        ))}
      </div>
      {!can && <p class="quiet small">{t.later}</p>}
      {kind && (
        <div class="row next" role="status">
          <span class="grow">{t.hints[kind]}</span>
          {["polyline", "area"].includes(kind) && 1 < pending.value.length && <button onClick={() => addMeasured([0, 0], true)}>{t.end}</button>}
          <button onClick={() => {
            pending.value = [];
            tool.value = "marks";
          }}>{t.stop}</button>
        </div>
      )}
      {0 < now.measurements.length && <Table />}
    </Step>
  );
}

function Table() {
  const order = useSignal<{ by: Column; down: boolean } | null>(null);
  const copied = useSignal(false);
  const rows = sorted(measurements.value, order.value);
  const head = (by: Column, title: string) => {
    const now = order.value?.by === by ? order.value : null;
    return (
      <th scope="col" class={by === "value" ? "number" : undefined} aria-sort={now ? (now.down ? "descending" : "ascending") : undefined}>
        <button class="plain" aria-label={t.sort(title)} onClick={() => (order.value = { by, down: !!now && !now.down })}>{title}{now && <span aria-hidden="true">{now.down ? " ↓" : " ↑"}</span>}</button>
      </th>
    );
  };
  const copy = async () => {
    const lines = rows.map((m) => [cell(m.name), texts.kinds[m.what], m.value ?? "", m.low ?? "", m.high ?? "", m.unit].join("\t"));
    try {
      await navigator.clipboard.writeText([[t.name, t.kind, t.value, "low 95 %", "high 95 %", "unit"].join("\t"), ...lines].join("\n"));
      copied.value = true;
    } catch {
      failed("measure", t.noCopy);
    }
  };
  return (
    <>
      <table class="measured">
        <caption class="visually-hidden">{t.table}</caption>
        <thead><tr>{head("name", t.name)}{head("what", t.kind)}{head("value", t.value)}<td /></tr></thead>
        <tbody>{rows.map((m) => <Row key={m.name} m={m} />)}</tbody>
      </table>
      <div class="row">
        <button onClick={copy}>{t.copy}</button>
        <button onClick={async () => {
          const { name, blob } = await transport.exported(session.value!, photo.value, "csv");
          download(name, blob);
        }}>{t.csv}</button>
        <span class="small quiet" role="status">{copied.value && t.copied}</span>
      </div>
    </>
  );
}

/** A text as a cell: spreadsheets take what begins with one of these for a formula. As in the CSV file, an apostrophe marks it as text. */
function cell(text: string): string {
  const isFormula = /^[=+\-−@\t\r\n]/.test(text);
  return isFormula || /[,;"\n\r\t]/.test(text) ? `"${isFormula ? "'" : ""}${text.replaceAll('"', '""')}"` : text;
}

function sorted(all: MeasurementView[], order: { by: Column; down: boolean } | null): MeasurementView[] {
  if (!order) return all;
  const compare = (a: MeasurementView, b: MeasurementView) =>
    order.by === "value" ? (a.value ?? Infinity) - (b.value ?? Infinity) : a[order.by].localeCompare(b[order.by], "en", { numeric: true });
  return [...all].sort((a, b) => (order.down ? -1 : 1) * compare(a, b));
}

function Row({ m }: { m: MeasurementView }) {
  const isSelected = selected.value?.kind === "measurement" && selected.value.name === m.name;
  return (
    <tr data-selected={isSelected} data-measurement={m.name}>
      <th scope="row"><button class="plain" aria-pressed={isSelected} onClick={async () => {
        if (m.photo !== photo.value) await showPhoto(m.photo);
        selected.value = { kind: "measurement", name: m.name, index: 0 };
      }}>{m.name}</button></th>
      <td>{texts.kinds[m.what]}</td>
      <td class="number">{m.error ? <span class="quiet">{m.error}</span> : <strong>{m.words}</strong>}</td>
      <td class="number"><button class="plain" aria-label={t.remove(m.name)} onClick={() => apply({ kind: "remove_measurement", name: m.name }, "measure")}>✕</button></td>
    </tr>
  );
}
