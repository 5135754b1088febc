// Step 2: what the marks are, their distances or coordinates, and how exact they are.
import { useSignal } from "@preact/signals";
import type { PointView, Template } from "../../api/types";
import { Pick } from "../../parts/files";
import { Pictogram } from "../pictograms";
import { photographTexts as texts } from "../../texts/photograph";
import { addsMark, apply, cancel, failed, needsMarks, nextMark, sameHandle, selected, tool, view, viewport } from "../store";
import { DistanceInput, shortest } from "../chips";
import { Field } from "../field";
import { number, pairs } from "../pairs";
import { Step } from "./step";

const t = texts.marks;
const TEMPLATES: Template[] = ["line_and_post", "four_points", "rectangle", "target", "own"];

export function MarksStep() {
  const now = view.value!;
  const isMissing = now.missing.some((one) => one.step === "marks");
  const names = now.points.length <= 8 ? now.points.map((point) => point.name).join(" ") : `${now.points.length}`;
  const worst = now.points.find((point) => point.is_worst);
  return (
    <Step n={2} name="marks" done={0 < now.points.length && !isMissing && !now.refusal} summary={names}>
      <Templates />
      {isMissing && <p class="small">{t.hints[now.template]}</p>}
      {now.template === "target" && <FindTarget />}
      {nextMark.value && <p class="next" role="status">{now.names_elsewhere.length ? t.known(nextMark.value) : t.next(nextMark.value)}</p>}
      <Distances />
      {0 < now.points.length && (
        <details class="more" open={now.template === "own" || now.points.some((point) => point.half_width_95_m)}>
          <summary>{t.points}{worst && <span class="quiet small"> · {t.worst} {worst.name}: {worst.residual_px!.toFixed(2)} px</span>}</summary>
          <Points />
          <Exactness />
        </details>
      )}
      {now.template !== "target" && needsMarks.value <= now.points.length && (
        <button aria-pressed={addsMark.value} onClick={() => {
          tool.value = "marks";
          addsMark.value = !addsMark.value;
        }}>{addsMark.value ? t.stop : t.add}</button>
      )}
    </Step>
  );
}

function Templates() {
  const now = view.value!;
  const open = useSignal(false);
  const choose = (template: Template) => {
    open.value = false;
    if (template !== now.template) void apply({ kind: "set_template", template });
  };
  const shown = open.value || now.points.length === 0 ? TEMPLATES : [now.template];
  return (
    <div class="templates" role="group" aria-label={t.template}>
      {shown.map((template) => (
        <button key={template} aria-pressed={template === now.template} onClick={() => (shown.length === 1 ? (open.value = true) : choose(template))}>
          <Pictogram of={template} />
          <span class="words"><strong>{texts.templates[template].title}</strong><span class="small quiet">{texts.templates[template].text}</span></span>
          {shown.length === 1 && <span class="quiet" aria-hidden="true">▾</span>}
        </button>
      ))}
    </div>
  );
}

function FindTarget() {
  const size = useSignal("");
  const family = useSignal("any");
  const looking = useSignal<number | null>(null);
  const find = async (target: Parameters<typeof apply>[0] & { kind: "find_target" }) => {
    looking.value = 0;
    const clock = setInterval(() => (looking.value = (looking.value ?? 0) + 1), 1000);
    await apply(target);
    clearInterval(clock);
    looking.value = null;
  };
  return (
    <div class="column">
      <Pick class="main" accept=".toml,.yaml,.yml,.json" onFiles={async ([file]) => file && find({ kind: "find_target", target: { by: "file", name: file.name, text: await file.text() } })}>{texts.target.file}</Pick>
      <form
        class="row"
        onSubmit={(event) => {
          event.preventDefault();
          const size_m = number(size.value);
          if (0 < size_m) void find({ kind: "find_target", target: { by: "family", family: family.value, size_m } });
          else failed("marks", texts.target.noSize);
        }}
      >
        <label class="grow small">{texts.target.family}
          <input autocomplete="off" value={family.value} onInput={(event) => (family.value = event.currentTarget.value)} />
        </label>
        <label class="grow small">{texts.target.size}
          <input inputMode="decimal" autocomplete="off" placeholder="0.10" value={size.value} onInput={(event) => (size.value = event.currentTarget.value)} />
        </label>
        <button disabled={looking.value !== null}>{texts.target.find}</button>
      </form>
      {looking.value !== null && (
        <div class="row" role="status">
          <progress aria-label={texts.target.looking(looking.value)} />
          <span class="grow">{texts.target.looking(looking.value)}</span>
          <button type="button" onClick={cancel}>{texts.target.cancel}</button>
        </div>
      )}
    </div>
  );
}

function Distances() {
  const now = view.value!;
  const all = pairs(now.template, now.points, now.distances);
  const hasDistances = !["target", "own"].includes(now.template);
  if (!hasDistances || now.points.length < 2) return null;
  return (
    <table class="distances">
      <caption class="visually-hidden">{t.distances}</caption>
      <tbody>
        {all.map(({ a, b, typed }) => (
          <tr key={`${a} ${b}`}>
            <th scope="row">{t.short(a, b)}</th>
            <td><span class="unit"><DistanceInput a={a} b={b} typed={typed} /> m</span></td>
            <td>{typed && <span class="unit">± <SigmaInput a={a} b={b} distance_m={typed.distance_m} sigma_m={typed.sigma_m} /> m</span>}</td>
            <td class="small quiet">{typed?.computed_m != null && 0.002 < Math.abs(typed.computed_m / typed.distance_m - 1) && t.computed(typed.computed_m.toPrecision(4))}</td>
          </tr>
        ))}
      </tbody>
      {3 <= now.points.length && now.template !== "rectangle" && <FurtherDistance />}
    </table>
  );
}

function SigmaInput({ a, b, distance_m, sigma_m }: { a: string; b: string; distance_m: number; sigma_m: number }) {
  const state = (text: string) => {
    const sigma = number(text);
    if (0 < sigma) void apply({ kind: "set_distance", a, b, distance_m, sigma_m: sigma });
    else failed("marks", t.noNumber);
    return 0 < sigma;
  };
  return <Field class="short" label={t.sigma(a, b)} value={String(Number(sigma_m.toPrecision(3)))} onState={state} />;
}

/** A distance that the template does not ask for: it checks the others. */
function FurtherDistance() {
  const now = view.value!;
  const names = now.points.map((point) => point.name);
  const a = useSignal(names[0]!);
  const b = useSignal(names.at(-1)!);
  const open = useSignal(false);
  const select = (label: string, value: typeof a) => (
    <label class="row tight small">{label}<select value={value.value} onChange={(event) => (value.value = event.currentTarget.value)}>{names.map((name) => <option key={name}>{name}</option>)}</select></label>
  );
  if (!open.value) return <tfoot><tr><td colSpan={4}><button class="plain" onClick={() => (open.value = true)}>+ {t.addDistance}</button></td></tr></tfoot>;
  return (
    <tfoot>
      <tr><td colSpan={4}><div class="row">{select(t.from, a)}{select(t.to, b)}<span class="unit"><DistanceInput key={`${a.value} ${b.value}`} a={a.value} b={b.value} typed={null} /> m</span></div></td></tr>
    </tfoot>
  );
}

/** Beyond so many points only the table of the worst is of use. */
const SHOWN = 12;

function Points() {
  const now = view.value!;
  if (now.points.length === 0) return null;
  const sorted = now.points.length <= SHOWN ? now.points : [...now.points].sort((p, q) => (q.residual_px ?? 0) - (p.residual_px ?? 0)).slice(0, SHOWN);
  return (
    <table class="mark-table">
      <caption class="visually-hidden">{t.points}</caption>
      <tbody>{sorted.map((point) => <PointRow key={point.name} point={point} />)}</tbody>
    </table>
  );
}

function PointRow({ point }: { point: PointView }) {
  const now = view.value!;
  const isSelected = sameHandle(selected.value, { kind: "mark", name: point.name });
  const isOwn = now.template === "own";
  return (
    <>
      <tr data-selected={isSelected} class={isOwn ? "open" : undefined}>
        <th scope="row">
          <button class="plain" aria-pressed={isSelected} onClick={() => {
            selected.value = { kind: "mark", name: point.name };
            viewport.reveal([point.u_px, point.v_px]);
          }}>{point.name}</button>
        </th>
        <td class="number small">
          {point.residual_px != null && <>{t.residual} {point.residual_px.toFixed(2)} px</>}
          {point.is_suspect ? <strong class="worst"> {t.suspect}</strong> : point.is_worst && <span> {t.worst}</span>}
          {point.half_width_95_m && point.position_m && <Spatial point={point} />}
        </td>
        <td class="number"><button class="plain" aria-label={t.remove(point.name)} onClick={() => apply({ kind: "remove_point", name: point.name })}>✕</button></td>
      </tr>
      {isOwn && <tr><td colSpan={3}><Coordinates point={point} /></td></tr>}
    </>
  );
}

/** Where several photographs put a point. */
function Spatial({ point }: { point: PointView }) {
  const place = point.position_m!;
  const half = point.half_width_95_m!;
  return (
    <span class="spatial" aria-label={t.spatial}>
      {["x", "y", "z"].map((axis, i) => <span key={axis}>{axis} {place[i]!.toFixed(3)} ± {half[i]!.toFixed(3)} m</span>)}
    </span>
  );
}

function Coordinates({ point }: { point: PointView }) {
  // Kept until x and y are there: only together are they a position.
  const typed = useSignal<(number | null)[]>(point.position_m ? [...point.position_m] : [null, null, 0]);
  const rename = (to: string) => void apply({ kind: "rename_point", name: point.name, to });
  const state = (i: number) => (text: string) => {
    const value = number(text);
    if (Number.isNaN(value)) {
      failed("marks", t.noNumber);
      return false;
    }
    typed.value = typed.value.map((old, k) => (k === i ? value : old));
    const [x_m, y_m, z_m] = typed.value;
    if (x_m != null && y_m != null) void apply({ kind: "set_position", name: point.name, x_m, y_m, z_m: z_m ?? 0 });
    return true;
  };
  return (
    <div class="row tight coordinates">
      <Field class="short" mode="text" label={t.rename(point.name)} value={point.name} onState={rename} />
      {(["x", "y", "z"] as const).map((axis, i) => (
        <label key={axis} class="unit"><span class="quiet">{axis}</span>
          <Field placeholder="?" label={t.coordinates(point.name, axis)} value={typed.value[i] == null ? "" : shortest(typed.value[i]!)} onState={state(i)} />
        </label>
      ))}
      <span class="quiet">m</span>
    </div>
  );
}

function Exactness() {
  const state = (text: string) => {
    const sigma_px = number(text);
    if (0 < sigma_px) void apply({ kind: "set_sigma", sigma_px });
    else failed("marks", t.noPixels);
    return 0 < sigma_px;
  };
  return (
    <label class="row tight small" title={t.sigmaPxHelp}>
      <span class="quiet">{t.sigmaPx} ±</span>
      <Field class="short" value={String(view.value!.sigma_px)} onState={state} />
      <span class="quiet">px</span>
    </label>
  );
}
