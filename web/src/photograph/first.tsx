// The first screen: what the page is for, and the ways to begin.
import { useEffect } from "preact/hooks";
import { signal } from "@preact/signals";
import { Drop, Pick } from "../parts/files";
import { Menu } from "../parts/menu";
import { Note } from "../parts/status";
import { photographTexts as texts } from "../texts/photograph";
import { Pictogram } from "./pictograms";
import { transport } from "../transport";
import { addTaken, busy, error, forgetKept, offered, open, openKept, takeFiles, takeFrame } from "./store";

const t = texts.first;
const IMAGES = "image/png,image/jpeg";

/** Names of the cameras that the program watches. */
const cameras = signal<string[]>([]);

/** Asks once whether cameras are watched. */
export function useCameras() {
  useEffect(() => {
    transport.cameras().then((names) => (cameras.value = names), () => (cameras.value = []));
  }, []);
}

/** A frame of a watched camera, where there is one. */
export function FrameMenu() {
  if (!cameras.value.length) return null;
  return <Menu label={t.frame}>{cameras.value.map((name) => <button key={name} onClick={() => takeFrame(name)}>{name}</button>)}</Menu>;
}

export function First() {
  return (
    <Drop class="first" label={t.drop} onFiles={takeFiles}>
      <h1>{t.title}</h1>
      <p>{t.text}</p>
      {offered.value && (
        <div class="offered" role="status">
          <span class="grow">{t.kept(offered.value.names, new Date(offered.value.kept_ms))}</span>
          <button class="main" onClick={openKept}>{t.goOn}</button>
          <button onClick={forgetKept}>{t.forget}</button>
        </div>
      )}
      <div class="dropzone">
        <p class="drop">{t.drop}</p>
        <div class="row centre">
          <Pick class="main" accept={IMAGES} multiple onFiles={takeFiles}>{t.choose}</Pick>
          <Pick accept={IMAGES} capture="environment" onFiles={([file]) => file && addTaken(file)}>{t.device}</Pick>
          <FrameMenu />
        </div>
      </div>
      <div class="row centre">
        <button onClick={() => open({ example: true })}>{t.example}</button>
        <Pick accept=".toml" onFiles={takeFiles}>{t.load}</Pick>
      </div>
      <p role="status" class="busy">{busy.value}</p>
      {error.value && <Note tone="bad" live>{error.value.text}</Note>}
      <ol>{t.how.map(({ of, text }) => <li key={of}><Pictogram of={of} />{text}</li>)}</ol>
      <p class="quiet small">{t.local}</p>
    </Drop>
  );
}
