// Step 1: what is known of the lens.
import { signal, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Pick } from "../../parts/files";
import { Note } from "../../parts/status";
import { sentence } from "../../texts/common";
import { photographTexts as texts } from "../../texts/photograph";
import type { GivenLens, LineDirection } from "../../api/types";
import { transport } from "../../transport";
import { apply, lensLines, lineOf, pending, tool, view } from "../store";
import { number } from "../pairs";
import { Step } from "./step";

const t = texts.lens;

export function LensStep() {
  const changing = useSignal(false);
  const lens = view.value?.lens;
  const open = !lens || changing.value;
  const set = async (given: GivenLens) => {
    const next = await apply({ kind: "set_lens", lens: given }, "lens");
    if (next && !next.error) changing.value = false;
  };
  return (
    <Step n={1} name="lens" done={lens?.state === "given" || lens?.state === "estimated"} summary={lens ? lens.words : t.none}>
      {open ? <Choices set={set} /> : (
        <>
          {lens.error && <Note tone="bad">{lens.error}</Note>}
          {lens.remark && <Note tone="grey">{sentence(lens.remark)}</Note>}
          <div class="row">
            {lens.hfov_deg != null && <span class="quiet grow">{t.hfov(lens.hfov_deg)}{lens.model && ` · ${lens.model}`}</span>}
            <button onClick={() => (changing.value = true)}>{t.change}</button>
          </div>
        </>
      )}
    </Step>
  );
}

/** Cameras of the list; asked for once. */
const cameras = signal<string[]>([]);

function Common({ set }: { set: (lens: GivenLens) => Promise<void> }) {
  useEffect(() => {
    if (!cameras.value.length) transport.get<{ name: string }[]>("/api/session/cameras").then((all) => (cameras.value = all.map(({ name }) => name)), () => {});
  }, []);
  return (
    <div class="choice">
      <select aria-label={t.common} value="" onChange={(event) => event.currentTarget.value && set({ by: "common", name: event.currentTarget.value })}>
        <option value="">{t.common}</option>
        {cameras.value.map((name) => <option key={name} value={name}>{name}</option>)}
      </select>
      <p class="small quiet">{t.commonHelp}</p>
    </div>
  );
}

/** Photographs of the session whose lens this one may take: the same camera gives photographs of one size. */
function Others({ set }: { set: (lens: GivenLens) => Promise<void> }) {
  const now = view.value!;
  const { width_px, height_px } = now.photo!;
  const others = now.photos.filter((one, number) => number !== now.photo_index && one.width_px === width_px && one.height_px === height_px);
  return (
    <div class="choice">
      {others.map(({ name, lends_lens }) => (
        <button key={name} class="cut" disabled={!lends_lens} onClick={() => set({ by: "photograph", name })}>{t.other(name)}</button>
      ))}
      <p class="small quiet">{others.length ? t.otherHelp : t.secondHelp}</p>
    </div>
  );
}

const DIRECTIONS: LineDirection[] = ["up", "along", "across", "horizon"];

function Lines({ set }: { set: (lens: GivenLens) => Promise<void> }) {
  const count = (direction: LineDirection) => lensLines.value.filter((line) => line.direction === direction).length;
  const directions = DIRECTIONS.filter((direction) => 0 < count(direction)).length;
  const active = lineOf(tool.value);
  return (
    <div class="choice">
      <div class="row" role="group" aria-label={t.lines}>
        {DIRECTIONS.map((direction) => (
          <button key={direction} aria-pressed={active === direction} onClick={() => {
            pending.value = [];
            tool.value = active === direction ? "marks" : `line_${direction}`;
          }}>{t.directions[direction]}{0 < count(direction) && ` · ${count(direction)}`}</button>
        ))}
      </div>
      <p class="small quiet">{active ? t.lineHint[active] : t.linesHelp}</p>
      {0 < lensLines.value.length && (
        <div class="row">
          <button class="main" disabled={lensLines.value.length < 3 || directions < 2} onClick={async () => {
            tool.value = "marks";
            await set({ by: "lines", lines: lensLines.value });
          }}>{t.useLines(lensLines.value.length)}</button>
          <button onClick={() => (lensLines.value = lensLines.value.slice(0, -1))}>{t.lastLine}</button>
        </div>
      )}
    </div>
  );
}

/** The lens that the photograph states, the camera of the list that it names, or what to do without either. */
function Exif({ set }: { set: (lens: GivenLens) => Promise<void> }) {
  const { has_exif_lens, common_camera, exif_advice } = view.value!.photo!;
  return (
    <div class="choice">
      {common_camera
        ? <button onClick={() => set({ by: "common", name: common_camera })}>{t.exifCamera(common_camera)}</button>
        : <button disabled={!has_exif_lens} onClick={() => set({ by: "exif" })}>{t.exif}</button>}
      <p class="small quiet">{exif_advice ?? t.exifHelp}</p>
    </div>
  );
}

function Choices({ set }: { set: (lens: GivenLens) => Promise<void> }) {
  const degrees = useSignal("");
  const hfov_deg = number(degrees.value);
  return (
    <div class="choices">
      <div class="choice">
        <Pick class="main" accept=".yaml,.yml,.toml,.json,.xml,.txt,.ini,.cameramodel" onFiles={async ([file]) => file && set({ by: "file", name: file.name, text: await file.text() })}>{t.file}</Pick>
        <p class="small quiet">{t.fileHelp}</p>
      </div>
      <Exif set={set} />
      <form
        class="choice"
        onSubmit={(event) => {
          event.preventDefault();
          void set({ by: "field_of_view", hfov_deg });
        }}
      >
        <label class="row tight"><span>{t.fov}</span><input class="short" inputMode="decimal" autocomplete="off" value={degrees.value} onInput={(event) => (degrees.value = event.currentTarget.value)} /><span class="quiet cut">{t.fovUnit}</span><button disabled={Number.isNaN(hfov_deg)}>{t.use}</button></label>
        <p class="small quiet">{t.fovHelp}</p>
      </form>
      <Common set={set} />
      <Lines set={set} />
      <Others set={set} />
      <div class="choice">
        <button onClick={() => set({ by: "unknown" })}>{t.unknown}</button>
        <p class="small quiet">{t.unknownHelp}</p>
      </div>
    </div>
  );
}
