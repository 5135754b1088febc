// The tab Photograph: four steps from a photograph to what is measured on it.
import { useEffect } from "preact/hooks";
import { Drop } from "../parts/files";
import { Note, Status } from "../parts/status";
import { Sheet } from "../parts/sheet";
import { photographTexts as texts } from "../texts/photograph";
import { ChoiceBar, Photos, SnapBar, Tools } from "./bars";
import { Birdseye } from "./birdseye";
import { First, useCameras } from "./first";
import { Keys } from "./keys";
import { Menus } from "./menus";
import { Stage, leave } from "./stage";
import { AnswerStep } from "./steps/answer";
import { LensStep } from "./steps/lens";
import { MarksStep } from "./steps/marks";
import { MeasureStep } from "./steps/measure";
import { apply, busy, changedElsewhere, error, resume, showsBirdseye, showsKeys, takeFiles, view } from "./store";

/** Keys that hold everywhere in the tab. */
function keys(event: KeyboardEvent) {
  const isTyping = event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
  if (!view.value?.photo || isTyping) return;
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && key === "z") void apply({ kind: event.shiftKey ? "redo" : "undo" });
  else if ((event.ctrlKey || event.metaKey) && key === "y") void apply({ kind: "redo" });
  else if (event.key === "?" && !event.defaultPrevented) showsKeys.value = true;
  else if (event.key === "Escape" && !event.defaultPrevented && !document.querySelector("dialog[open]")) leave();
  else return;
  event.preventDefault();
}

/** The answer in a line, for the sheet's handle on a phone. */
function Summary() {
  const now = view.value!;
  const height = now.figures.find((figure) => figure.name === "height");
  if (!now.answer || !height) return <span class="small">{now.missing[0]?.text}</span>;
  return (
    <span class="row tight">
      <Status word={now.is_old ? "old" : now.answer.status} />
      <span class="cut">{height.title} <strong>{height.words}</strong></span>
    </span>
  );
}

export function Photograph() {
  useCameras();
  useEffect(() => {
    void resume();
    document.addEventListener("keydown", keys);
    return () => document.removeEventListener("keydown", keys);
  }, []);
  const now = view.value;
  if (!now?.photo) return <First />;
  return (
    <>
      <h1 class="visually-hidden">{texts.title}</h1>
      <Menus />
      <Keys />
      <Drop class="split" label={texts.title} onFiles={takeFiles}>
        <div class="stage">
          <Photos />
          <div class="views">
            <Stage />
            {showsBirdseye.value && <Birdseye />}
            <div class="bars">
              <SnapBar where="stage" />
              <ChoiceBar where="stage" />
            </div>
          </div>
          <Tools />
        </div>
        <Sheet label={texts.panel} summary={<Summary />} asks={<SnapBar where="panel" />}>
          <ChoiceBar where="panel" />
          {busy.value && <p class="busy" role="status">{busy.value}</p>}
          {changedElsewhere.value && <Note tone="grey" live>{texts.elsewhere}</Note>}
          {error.value?.step === "photograph" && <Note tone="bad" live>{error.value.text}</Note>}
          <LensStep />
          <MarksStep />
          <AnswerStep />
          <MeasureStep />
        </Sheet>
      </Drop>
    </>
  );
}
