// Step 1: what is known of the lens.
import { useSignal } from "@preact/signals";
import { Pick } from "../../parts/files";
import { Note } from "../../parts/status";
import { sentence } from "../../texts/common";
import { photographTexts as texts } from "../../texts/photograph";
import type { GivenLens } from "../../api/types";
import { apply, view } from "../store";
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
    <Step n={1} name="lens" done={!!lens && lens.state !== "refused"} summary={lens ? lens.words : t.none}>
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

function Choices({ set }: { set: (lens: GivenLens) => Promise<void> }) {
  const degrees = useSignal("");
  const hfov_deg = number(degrees.value);
  return (
    <div class="choices">
      <div class="choice">
        <Pick class="main" accept=".yaml,.yml,.toml,.json,.xml,.txt,.ini,.cameramodel" onFiles={async ([file]) => file && set({ by: "file", name: file.name, text: await file.text() })}>{t.file}</Pick>
        <p class="small quiet">{t.fileHelp}</p>
      </div>
      <div class="choice">
        <button disabled={!view.value?.photo?.has_exif_lens} onClick={() => set({ by: "exif" })}>{t.exif}</button>
        <p class="small quiet">{t.exifHelp}</p>
      </div>
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
      <div class="choice">
        <button onClick={() => set({ by: "unknown" })}>{t.unknown}</button>
        <p class="small quiet">{t.unknownHelp}</p>
      </div>
    </div>
  );
}
