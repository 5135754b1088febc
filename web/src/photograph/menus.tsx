// Session and export: files in and out.
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Confirm } from "../parts/dialog";
import { Pick, download } from "../parts/files";
import { Menu } from "../parts/menu";
import { drawPicture } from "../parts/picture";
import { printDocument } from "../parts/printed";
import { ViewportState } from "../parts/transform";
import { common } from "../texts/common";
import { photographTexts as texts } from "../texts/photograph";
import { Actions } from "../tabs";
import { transport } from "../transport";
import { layers } from "./draw";
import { failed, open, photo, picture, selected, session, takeFiles, view } from "./store";

const t = texts.exports;
/** Offered by names of their own, or not as a pose. */
const OTHERS = ["svg", "report", "csv"];

export function Menus() {
  const asks = useSignal(false);
  const formats = useSignal<string[]>([]);
  useEffect(() => {
    transport.get<string[]>("/api/session/exports").then((words) => (formats.value = words), () => {});
  }, []);
  const now = view.value;
  const hasPose = !!now?.answer && !now.is_old && now.figures.length > 0;
  const save = (format: string) => async () => {
    try {
      const { name, blob } = await transport.exported(session.value!, photo.value, format);
      download(name, blob);
    } catch (problem) {
      failed("answer", problem);
    }
  };
  return (
    <Actions>
      <Menu label={texts.session.menu}>
        <button onClick={() => (asks.value = true)}>{texts.session.fresh}</button>
        <button onClick={() => open({ example: true })}>{texts.session.example}</button>
        <Pick accept=".toml" onFiles={takeFiles}>{texts.session.load}</Pick>
        <button disabled={!now?.photo} onClick={saveSession}>{texts.session.save}</button>
      </Menu>
      <Menu label={t.menu} disabled={!hasPose}>
        <h3>{t.image}</h3>
        <button onClick={() => savePng()}>{t.png}</button>
        <button onClick={save("svg")}>{t.svg}</button>
        <button onClick={saveBirdseye}>{t.birdseye}</button>
        <h3>{texts.steps.answer}</h3>
        <button onClick={save("report")}>{t.report}</button>
        <button onClick={printReport}>{t.print}</button>
        <button onClick={save("csv")}>{t.csv}</button>
        <h3>{t.pose}</h3>
        {formats.value.filter((word) => !OTHERS.includes(word)).map((word) => <button key={word} onClick={save(word)}>{t.names[word] ?? word}</button>)}
      </Menu>
      {asks.value && (
        <Confirm title={texts.session.askFresh} yes={texts.session.yes} no={common.cancel} onClose={() => (asks.value = false)} onYes={async () => {
          asks.value = false;
          await open();
        }}>
          <p>{texts.session.askText}</p>
        </Confirm>
      )}
    </Actions>
  );
}

async function printReport() {
  try {
    const { blob } = await transport.exported(session.value!, photo.value, "report");
    await printDocument(await blob.text());
  } catch (problem) {
    failed("answer", problem);
  }
}

async function saveSession() {
  try {
    const { name, blob } = await transport.save(session.value!);
    download(name, blob);
  } catch (problem) {
    failed("photograph", problem);
  }
}

async function saveBirdseye() {
  try {
    download("birdseye.png", await transport.birdseye(session.value!, photo.value));
  } catch (problem) {
    failed("answer", problem);
  }
}

/** The photograph with everything drawn over it, at its own size. */
async function savePng() {
  const shown = picture.value;
  if (!shown) return;
  const { turns } = shown;
  const [width, height] = turns % 2 ? [shown.height, shown.width] : [shown.width, shown.height];
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d")!;
  // Lines and letters as large as on a screen 1000 px wide.
  const ratio = Math.max(1, Math.max(width, height) / 1000);
  const state = new ViewportState();
  state.resized(width / ratio, height / ratio);
  state.show(shown.width, shown.height, turns);
  drawPicture(context, shown, state.transform.value, ratio);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const before = selected.value;
  selected.value = null;
  layers.forEach((layer) => layer(context, state));
  selected.value = before;
  canvas.toBlob((blob) => blob && download("photograph.png", blob), "image/png");
}
