// The tab Rig: where the cameras are, how uncertain that is, and what it rests on.
import "../style/space.css";
import { signal } from "@preact/signals";
import { useMemo, useRef, useState } from "preact/hooks";
import type { RigView } from "../api/types";
import { Drop, Pick } from "../parts/files";
import { Figure } from "../parts/figure";
import { Sheet } from "../parts/sheet";
import { Note, Status } from "../parts/status";
import { Toolbar } from "../parts/toolbar";
import { factor, fixed } from "../results/format";
import { Result } from "../results/result";
import { Outcome, Start } from "../results/start";
import { SpaceCanvas } from "../space/canvas";
import type { SpaceShown, SpaceView, Way } from "../space/view";
import { Actions } from "../tabs";
import { rigTexts as texts } from "../texts/rig";
import { sceneOf } from "./scene";
import { Cameras, Pairs, Rejected, Views } from "./tables";

const result = new Result<RigView>("/api/rig", texts);
/** The view that is looked at; all where there is none. */
const chosen = signal<string | null>(null);
const WAYS: Way[] = ["start", "top", "front", "side"];

export function Rig() {
  const rig = result.value.value;
  return rig ? <Shown rig={rig} /> : <Start result={result} texts={texts} />;
}

function take(files: File[]) {
  void result.take(files).then(() => (chosen.value = null));
}

function Shown({ rig }: { rig: RigView }) {
  const view = rig.views.some((row) => row.view === chosen.value) ? chosen.value : null;
  const scene = useMemo(() => sceneOf(rig, view), [rig, view]);
  const [shown, setShown] = useState<SpaceShown>({ targets: true, sights: false, ellipsoids: true, names: true });
  const space = useRef<SpaceView | null>(null);
  const hasEllipsoids = rig.cameras.some((camera) => 0 < camera.half_axes_m.length);
  return (
    <Drop class="results-drop" label={texts.drop} onFiles={take}>
      <Actions>
        <Pick multiple onFiles={take}>{texts.other}</Pick>
        <button onClick={() => result.close()}>{texts.close}</button>
      </Actions>
      <div class="split results">
        <div class="stage">
          <SpaceCanvas scene={scene} shown={shown} label={texts.space} onView={(made) => (space.current = made)} />
          <div class="caption" data-caption>
            {hasEllipsoids ? texts.magnified(factor(rig.ellipsoid_magnification)) : texts.noEllipsoids}
            {1 < rig.targets_one_in && ` ${texts.targetsOneIn(rig.targets_one_in)}`}
          </div>
          <Toolbar label={texts.waysLabel}>
            {WAYS.map((way) => <button key={way} onClick={() => space.current?.look(way)}>{texts.ways[way]}</button>)}
            <button aria-label={texts.nearer} onClick={() => space.current?.come(0.8)}><span aria-hidden="true">+</span></button>
            <button aria-label={texts.farther} onClick={() => space.current?.come(1.25)}><span aria-hidden="true">−</span></button>
            {(Object.keys(shown) as (keyof SpaceShown)[]).map((key) => (
              <label class="check" key={key}>
                <input type="checkbox" checked={shown[key]} onChange={(event) => setShown({ ...shown, [key]: event.currentTarget.checked })} />
                {texts.shown[key]}
              </label>
            ))}
          </Toolbar>
        </div>
        <Sheet label={texts.title}>
          <Summary rig={rig} />
          <Cameras rig={rig} />
          <Views rig={rig} view={view} choose={(name) => (chosen.value = name)} />
          <Pairs rig={rig} />
          <Rejected rig={rig} />
        </Sheet>
      </div>
    </Drop>
  );
}

function Summary({ rig }: { rig: RigView }) {
  const help = texts.figures;
  const { n_seen, n_used } = rig;
  const share = n_seen ? ` (${fixed((100 * (n_used ?? 0)) / n_seen, 1)} %)` : "";
  return (
    <section class="section" data-summary>
      <div class="row">
        <h1 class="visually-hidden">{texts.title}</h1>
        {rig.status ? <Status word={rig.status} text={texts.statusOf[rig.status]} /> : <Status word="none" text={texts.noStatus} />}
      </div>
      <Outcome result={result} texts={texts} />
      {rig.contradiction ? <Note tone="bad">{rig.contradiction}</Note> : <p>{rig.message}</p>}
      {rig.remarks.map((remark) => <Note key={remark} tone="grey">{remark}</Note>)}
      {rig.rms_px !== null && <Figure title={help.rms} words={`${fixed(rig.rms_px, 3)} px`} help={help.rmsHelp} link="report.md" name="rms" />}
      {n_seen !== null && n_used !== null && <Figure title={help.used} words={`${n_used} of ${n_seen}${share}`} help={help.usedHelp} link="report.md" name="used" />}
      {rig.n_views !== null && <Figure title={help.views} words={String(rig.n_views)} help={help.viewsHelp} link="rigs.md" name="views" />}
      {rig.reference && <Figure title={help.frame} words={rig.reference} help={help.frameHelp} link="rigs.md" name="frame" />}
      {rig.scale && <p class="quiet small">{rig.scale}</p>}
    </section>
  );
}
