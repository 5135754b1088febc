// What lies below the photograph: the choice between two poses, a snap to accept, and the tools. On small screens the first two would cover marks:
// there they are in the panel.
import type { SnapTo } from "../api/types";
import { isLow, isSmall } from "../parts/screen";
import { Toolbar } from "../parts/toolbar";
import { Pick } from "../parts/files";
import { photographTexts as texts } from "../texts/photograph";
import { acceptSnap, apply, photo, proposeSnap, selected, showPhoto, showsKeys, snapTo, snapped, takeFiles, view, viewport } from "./store";
import { FrameMenu } from "./first";
import { removeSelected } from "./stage";

const SNAPS: SnapTo[] = ["dot", "corner", "crossing"];

type Where = "stage" | "panel";
const isHere = (where: Where) => (where === "panel") === (isSmall.value || isLow.value);

export function ChoiceBar({ where }: { where: Where }) {
  const now = view.value;
  if (!isHere(where)) return null;
  if (!now?.overlay?.ghost || now.is_old) return null;
  const isChosen = 0 < now.chosen_pose;
  // Where the better of two does not fit, neither does.
  if (!isChosen && now.answer?.status === "inconsistent") return null;
  const other = isChosen ? 0 : 1;
  return (
    <div class="choice-bar" role="group" aria-label={texts.choice.two}>
      <span class="symbol" aria-hidden="true">⇄</span>
      <span class="grow">{isChosen ? texts.choice.chosen : texts.choice.two}</span>
      {!isChosen && <button onClick={() => apply({ kind: "choose_pose", index: 0 })}>{texts.choice.drawn}</button>}
      <button class="ghost" onClick={() => apply({ kind: "choose_pose", index: other })}>{isChosen ? texts.choice.back : texts.choice.ghost}</button>
    </div>
  );
}

export function SnapBar({ where }: { where: Where }) {
  const one = snapped.value;
  if (!one || !isHere(where)) return null;
  const words = one.found.words;
  return (
    <div class="choice-bar snap" role="status">
      <span class="grow">{words.charAt(0).toUpperCase() + words.slice(1)}</span>
      <button class="main" onClick={acceptSnap}>{texts.snap.accept} <kbd>Enter</kbd></button>
      <button onClick={() => (snapped.value = null)}>{texts.snap.refuse} <kbd>Esc</kbd></button>
    </div>
  );
}

export function Tools() {
  const now = view.value!;
  const b = texts.bar;
  return (
    <Toolbar label={b.label}>
      <button disabled={!now.can_undo} onClick={() => apply({ kind: "undo" })}><span aria-hidden="true">↶</span><span class="wide-only">{b.undo}</span><span class="visually-hidden narrow-only">{b.undo}</span></button>
      <button disabled={!now.can_redo} onClick={() => apply({ kind: "redo" })}><span aria-hidden="true">↷</span><span class="wide-only">{b.redo}</span><span class="visually-hidden narrow-only">{b.redo}</span></button>
      <button disabled={!selected.value} onClick={removeSelected}>{b.remove}</button>
      <label class="row tight small" title={texts.snap.help}>
        <span class="quiet wide-only">{texts.snap.label}</span>
        <select aria-label={texts.snap.label} value={snapTo.value ?? ""} onChange={(event) => {
          snapTo.value = (event.currentTarget.value || null) as SnapTo | null;
          if (selected.value) void proposeSnap(selected.value);
        }}>
          <option value="">{texts.snap.off}</option>
          {SNAPS.map((to) => <option key={to} value={to}>{texts.snap.to[to]}</option>)}
        </select>
      </label>
      <span class="spring" />
      <button aria-label={b.out} onClick={() => viewport.zoom(0.8)}>−</button>
      <button aria-label={b.in} onClick={() => viewport.zoom(1.25)}>+</button>
      <button onClick={() => viewport.fit()}>{b.fit}</button>
      <button aria-label={b.turn} onClick={() => viewport.turn()}>⟳</button>
      <button class="wide-only" onClick={() => (showsKeys.value = true)}>{b.keys} <kbd>?</kbd></button>
    </Toolbar>
  );
}

/** The photographs of the session, and how a further one is added. */
export function Photos() {
  const now = view.value!;
  return (
    <div class="photos" role="group" aria-label={texts.photos.label}>
      {now.photos.map(({ name }, number) => (
        <button key={name} aria-pressed={number === photo.value} title={name} onClick={() => showPhoto(number)}><span class="cut">{name}</span></button>
      ))}
      <span title={texts.photos.addHint}><Pick accept="image/png,image/jpeg" onFiles={takeFiles}>+ <span class="wide-only">{texts.photos.add}</span><span class="visually-hidden narrow-only">{texts.photos.add}</span></Pick></span>
      <FrameMenu />
    </div>
  );
}
