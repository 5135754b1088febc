// Camera × frame: of the points found in each of the last frames, those that agree with the pose. A bar is as high as their share.
import { liveTexts as texts } from "../texts/live";
import type { LiveStore } from "./store";

const FRAMES = 60;
const WIDE = 8;
const HIGH = 28;

export function PointTable({ store }: { store: LiveStore }) {
  return (
    <div class="points">
      <table>
        <caption>{texts.pointsCaption}</caption>
        <thead>
          <tr><th scope="col">{texts.pointsCamera}</th><th scope="col" class="bars">{texts.pointsNewest}</th><th scope="col" class="number">{texts.pointsShare}</th></tr>
        </thead>
        <tbody>
          {store.view.value!.cameras.map((camera) => (
            <tr key={camera.name} data-live={store.isLive(camera)}>
              <th scope="row" class="cut">{camera.name}</th>
              <td class="bars"><Bars points={camera.points as [number, number][]} /></td>
              <td class="number">{last(camera.points as [number, number][])}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <ul class="legend small">
        {(["all", "most", "few", "none"] as const).map((kind) => (
          <li key={kind}><svg viewBox="0 0 8 8" width="14" height="14" aria-hidden="true"><rect class={kind} width="8" height="8" /></svg> {texts.pointsLegend[kind]}</li>
        ))}
      </ul>
    </div>
  );
}

function last(points: [number, number][]): string {
  const [found, agree] = points.at(-1) ?? [0, -1];
  return agree < 0 ? `– / ${found}` : `${agree} / ${found}`;
}

function Bars({ points }: { points: [number, number][] }) {
  return (
    <svg class="shares" viewBox={`0 0 ${FRAMES * WIDE} ${HIGH}`} preserveAspectRatio="none" aria-hidden="true">
      {points.map(([found, agree], i) => {
        const share = agree < 0 || !found ? 0 : agree / found;
        const kind = agree < 0 ? "none" : share === 1 ? "all" : 0.5 < share ? "most" : "few";
        const height = agree < 0 ? 4 : Math.max(4, share * HIGH);
        return <rect key={i} class={kind} x={(FRAMES - points.length + i) * WIDE} y={HIGH - height} width={WIDE - 1} height={height} />;
      })}
    </svg>
  );
}
