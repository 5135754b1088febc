// The tab Whisker: the sweep played, where it touched, and the object behind that.
import "../style/space.css";
import { signal } from "@preact/signals";
import { useEffect, useMemo, useState } from "preact/hooks";
import type { Replay } from "../api/types";
import { Drop, Pick } from "../parts/files";
import { Sheet } from "../parts/sheet";
import { colours } from "../parts/theme";
import { ViewportState, type Point } from "../parts/transform";
import { Viewport } from "../parts/viewport";
import { MM, fixed } from "../results/format";
import { Start } from "../results/start";
import { Actions } from "../tabs";
import { whiskerTexts as texts } from "../texts/whisker";
import { drawSweep, frameOf, type Shown } from "./draw";
import { at, begin, chooseSweep, play, playing, reading, readings, result, sweep, sweeps } from "./player";
import { Found, Legend, Record } from "./verdict";

const NO_PICTURE = signal(null);
const ARROWS: Record<string, Point> = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
let begun: Replay | null = null;

export function Whisker() {
  const replay = result.value.value;
  if (replay !== begun) {
    begun = replay;
    if (replay) begin();
  }
  return replay ? <Shown replay={replay} /> : <Start result={result} texts={texts} />;
}

function Shown({ replay }: { replay: Replay }) {
  const [isNear, setNear] = useState(false);
  const [shown, setShown] = useState<Shown>({ shapes: true, ellipses: true, outline: true });
  const state = useMemo(() => new ViewportState(), []);
  const frame = useMemo(() => frameOf(isNear ? replay.locus_extent_m : replay.extent_m), [replay, isNear]);
  const choice = useMemo(() => signal(shown), []);
  choice.value = shown;
  const framed = useMemo(() => signal(frame), []);
  framed.value = frame;
  useEffect(() => state.show(frame.width, frame.height), [frame]);
  useEffect(() => () => void (playing.value = false), []);
  const take = (files: File[]) => void result.take(files);
  const keys = (event: KeyboardEvent) => {
    const arrow = ARROWS[event.key];
    if (arrow) state.pan(...(arrow as [number, number]));
    else if (event.key === "+" || event.key === "=") state.zoom(1.25);
    else if (event.key === "-") state.zoom(0.8);
    else if (event.key === "0") state.fit();
    else return;
    event.preventDefault();
  };
  return (
    <Drop class="results-drop" label={texts.drop} onFiles={take}>
      <Actions>
        <Pick multiple onFiles={take}>{texts.other}</Pick>
        <button onClick={() => result.close()}>{texts.close}</button>
      </Actions>
      <div class="split results">
        <div class="stage">
          <Viewport
            state={state}
            picture={NO_PICTURE}
            label={texts.stage}
            onKeyDown={keys}
            layers={[(pen, now) => {
              colours.value; // The theme.
              drawSweep(pen, now, framed.value, replay, readings.value, reading.value, choice.value);
            }]}
          />
          <div class="caption" tabIndex={0} role="group" aria-label={texts.legendLabel}><Legend replay={replay} /></div>
          <Player />
          <div class="player">
            <button aria-pressed={!isNear} onClick={() => setNear(false)}>{texts.whole}</button>
            <button aria-pressed={isNear} onClick={() => setNear(true)}>{texts.locus}</button>
            {(Object.keys(shown) as (keyof Shown)[]).map((key) => (
              <label class="check" key={key}>
                <input type="checkbox" checked={shown[key]} onChange={(event) => setShown({ ...shown, [key]: event.currentTarget.checked })} />
                {texts.shown[key]}
              </label>
            ))}
          </div>
        </div>
        <Sheet label={texts.title}>
          <h1 class="visually-hidden">{texts.title}</h1>
          <Now />
          <Found replay={replay} />
          <Record replay={replay} />
        </Sheet>
      </div>
    </Drop>
  );
}

function Player() {
  const n = readings.value.length;
  return (
    <div class="player">
      <button class="play main" onClick={play}>
        <span aria-hidden="true">{playing.value ? "❚❚" : "▶"}</span> {playing.value ? texts.pause : texts.play}
      </button>
      {1 < sweeps.value.length && (
        <select aria-label={texts.sweep} value={sweep.value} onChange={(event) => chooseSweep(Number(event.currentTarget.value))}>
          {sweeps.value.map((one, i) => <option key={one.number} value={i}>{texts.sweepN(one.number)}</option>)}
        </select>
      )}
      <input
        type="range" min={0} max={Math.max(0, n - 1)} step={1} value={at.value} aria-label={texts.slider} aria-valuetext={texts.now(at.value + 1, n)}
        onInput={(event) => {
          playing.value = false;
          at.value = Number(event.currentTarget.value);
        }}
      />
    </div>
  );
}

/** The reading that is shown, in words. */
function Now() {
  const now = reading.value;
  if (!now) return null;
  const { contact } = now;
  return (
    <section class="section" data-now>
      <h2>{texts.now(at.value + 1, readings.value.length)}</h2>
      <p>
        {texts.statuses[now.status] ?? now.status}
        {contact && <> {texts.modes[contact.mode]}, {texts.contact(fixed(MM * contact.x_m[0], 2), fixed(MM * contact.x_m[1], 2), fixed(MM * contact.sigma_m, 2))}</>}.
      </p>
      {now.note && <p class="quiet small">{now.note}</p>}
    </section>
  );
}
