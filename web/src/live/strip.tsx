// A camera through time: its states as a band, its rotation from the reference as a line. Drag to look closer.
import "uplot/dist/uPlot.min.css";
import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import type { StripView } from "../api/types";
import { colours, type Colours } from "../parts/theme";
import { Status, toneOf } from "../parts/status";
import { liveTexts as texts } from "../texts/live";
import { transport } from "../transport";
import type { LiveStore } from "./store";

const HEIGHT = 132;
const BAND = 14;
const AGAIN_MS = 5000;
/** Times beyond this are seconds since 1970. */
const UNIX_S = 1e9;
const DEGREES = 180 / Math.PI;

export function Strip({ camera, store }: { camera: string; store: LiveStore }) {
  const box = useRef<HTMLDivElement>(null);
  const strip = useSignal<StripView | null>(null);
  const zoom = useSignal<[number, number] | null>(null);
  useEffect(() => {
    let isGone = false;
    const ask = async () => {
      const query: Record<string, number> = zoom.value ? { from_s: zoom.value[0], to_s: zoom.value[1] } : {};
      const found = await transport.get<StripView>("/api/live/strip", { camera, bins: 240, ...query }).catch(() => null);
      if (!isGone && found) strip.value = found;
    };
    const stop = effect(() => {
      zoom.value;
      void ask();
    });
    const timer = setInterval(() => !zoom.value && void ask(), AGAIN_MS);
    return () => {
      isGone = true;
      stop();
      clearInterval(timer);
    };
  }, [camera]);
  useEffect(() => effect(() => {
    if (strip.value && box.current) plot(box.current, strip.value, colours.value, (from, to) => (zoom.value = [from, to]));
  }), []);
  useEffect(() => {
    const observer = new ResizeObserver(() => box.current && PLOTS.get(box.current)?.setSize({ width: box.current.clientWidth, height: HEIGHT }));
    observer.observe(box.current!);
    return () => observer.disconnect();
  }, []);
  const words = [...new Set(strip.value?.bins.map((bin) => bin.state).filter((state) => state != null))];
  return (
    <section class="strip" aria-label={texts.sections.history} data-live={store.isNow.value}>
      <div class="row tight">
        <h2>{texts.sections.history}</h2>
        <span class="row states grow">{words.map((word) => <Status key={word} word={word!} />)}</span>
        <button disabled={!zoom.value} onClick={() => (zoom.value = null)}>{texts.stripAll}</button>
      </div>
      <div ref={box} class="plot" role="img" aria-label={texts.stripLabel(camera)} onDblClick={() => (zoom.value = null)} data-bins={strip.value?.bins.length ?? 0} />
      <p class="small quiet">{strip.value ? `${strip.value.is_from_history ? texts.stripFrom.history : texts.stripFrom.memory}. ${texts.stripZoom}` : texts.stripNothing}</p>
    </section>
  );
}

const PLOTS = new WeakMap<HTMLElement, uPlot>();

function plot(box: HTMLElement, strip: StripView, ink: Colours, zoom: (from: number, to: number) => void) {
  PLOTS.get(box)?.destroy();
  const width = (strip.to_s - strip.from_s) / strip.bins.length;
  const data: uPlot.AlignedData = [
    strip.bins.map((bin) => bin.from_s + width / 2),
    strip.bins.map((bin) => (bin.rotation_rad == null ? null : bin.rotation_rad * DEGREES)),
  ];
  const axis = { stroke: ink.quiet, grid: { stroke: ink.line, width: 1 }, ticks: { stroke: ink.line, width: 1 }, font: "14px system-ui, sans-serif" };
  const made = new uPlot({
    width: box.clientWidth,
    height: HEIGHT,
    padding: [BAND + 6, 12, 0, 0],
    legend: { show: false },
    cursor: { drag: { x: true, y: false, setScale: false } },
    scales: { x: { time: UNIX_S < strip.from_s, range: [strip.from_s, strip.to_s] }, y: { range: (_, __, most) => [0, most ? 1.1 * most : 0.01] } },
    axes: [{ ...axis, ...(UNIX_S < strip.from_s && { values: times }) }, { ...axis, size: 64, values: (_, all) => all.map((x) => `${x}°`) }],
    series: [{}, { label: texts.stripAxis, stroke: ink.accent, width: 2, points: { show: false }, spanGaps: false }],
    hooks: {
      draw: [(at) => band(at, strip, ink)],
      setSelect: [(at) => {
        const { left, width: wide } = at.select;
        if (4 < wide) zoom(at.posToVal(left, "x"), at.posToVal(left + wide, "x"));
      }],
    },
  }, data, box);
  PLOTS.set(box, made);
}

/** Hours and minutes; the day where it begins. */
function times(_: uPlot, all: number[]): string[] {
  const isShort = 1 < all.length && all[1]! - all[0]! < 60;
  return all.map((unixS) => {
    const at = new Date(1e3 * unixS);
    const isMidnight = at.getHours() === 0 && at.getMinutes() === 0 && at.getSeconds() === 0;
    if (isMidnight) return at.toLocaleDateString("en-GB", { day: "numeric", month: "short" });
    return at.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit", ...(isShort && { second: "2-digit" }) });
  });
}

/** The states above the line: by colour, and by height for who does not tell colours apart. */
function band(at: uPlot, strip: StripView, ink: Colours) {
  const { ctx: pen } = at;
  const ratio = devicePixelRatio;
  const top = at.bbox.top - (BAND + 3) * ratio;
  const heights = { good: 0.4, grey: 0.55, warn: 0.7, bad: 1 };
  const width = (strip.to_s - strip.from_s) / strip.bins.length;
  for (const bin of strip.bins) {
    if (bin.state == null) continue;
    const tone = toneOf(bin.state);
    const from = at.valToPos(bin.from_s, "x", true);
    const to = at.valToPos(bin.from_s + width, "x", true);
    const high = heights[tone] * BAND * ratio;
    pen.fillStyle = ink[tone];
    pen.fillRect(from, top + BAND * ratio - high, Math.max(1, to - from + 0.5), high);
  }
}
