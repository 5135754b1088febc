// The tables of a rig.
import type { RigCamera, RigView, SeenCell } from "../api/types";
import { Status } from "../parts/status";
import { DEG, MM, fixed, plusMinus, sigmaOnly } from "../results/format";
import { rigTexts as texts } from "../texts/rig";

const N_COLOURS = 7;

function Swatch({ i }: { i: number }) {
  return <span class={`swatch c${i % N_COLOURS}`} aria-hidden="true" />;
}

const worst = (sigmas: readonly number[] | null) => (sigmas && 0 < Math.max(...sigmas) ? sigmaOnly(Math.max(...sigmas), DEG, "°") : "–");
const used = (n_used: number | null, n_seen: number | null) => (n_seen === null ? "–" : `${n_used ?? 0} of ${n_seen}`);
const rms = (px: number | null) => (px === null ? "–" : fixed(px, 3));

export function Cameras({ rig }: { rig: RigView }) {
  if (rig.cameras.length === 0) return null;
  return (
    <section class="section">
      <h2>{texts.cameras}</h2>
      <p class="quiet small">{texts.camerasNote}</p>
      <div class="wide" tabIndex={0} role="region" aria-label={texts.cameras}>
        <table data-table="cameras">
          <thead>
            <tr><th scope="col">{texts.camera}</th><th scope="col">{texts.position}</th><th scope="col">{texts.rotation}</th><th scope="col">{texts.points}</th><th scope="col">{texts.rms}</th></tr>
          </thead>
          <tbody>{rig.cameras.map((camera, i) => <CameraRow key={camera.name} camera={camera} i={i} />)}</tbody>
        </table>
      </div>
    </section>
  );
}

function CameraRow({ camera, i }: { camera: RigCamera; i: number }) {
  const { position_m, sigma_m, status } = camera;
  return (
    <tr>
      <th scope="row">
        <Swatch i={i} />{camera.name}
        {status && status !== "ok" && <div><Status word={status} text={texts.statusOf[status]} /></div>}
        {camera.message && <div class="small">{camera.message}</div>}
      </th>
      <td class="lines">
        {["x", "y", "z"].map((axis, k) => <div key={axis}>{axis} {plusMinus(position_m[k]!, sigma_m?.[k], MM, "mm")}</div>)}
      </td>
      <td>{worst(camera.sigma_rad)}</td>
      <td>{used(camera.n_used, camera.n_seen)}</td>
      <td>{rms(camera.rms_px)}</td>
    </tr>
  );
}

/** 0 (none used) to 10 (all): only a whole 1 is 10, only a whole 0 is 0. */
export function tenths({ n_used, n_seen }: SeenCell): number {
  if (n_used === 0) return 0;
  return n_used === n_seen ? 10 : Math.min(9, Math.max(1, Math.floor((10 * n_used) / n_seen)));
}

export function Views({ rig, view, choose }: { rig: RigView; view: string | null; choose: (view: string | null) => void }) {
  if (rig.views.length === 0) return null;
  const at = rig.views.findIndex((row) => row.view === view);
  const step = (by: number) => choose(rig.views[at + by]?.view ?? null);
  return (
    <section class="section">
      <div class="row">
        <h2 class="grow">{texts.views}</h2>
        <button aria-label={texts.before} disabled={at < 0} onClick={() => step(-1)}><span aria-hidden="true">◀</span></button>
        <span data-view-now>{view === null ? texts.allViews : `${texts.view} ${view}`}</span>
        <button aria-label={texts.after} disabled={at === rig.views.length - 1} onClick={() => step(1)}><span aria-hidden="true">▶</span></button>
      </div>
      <p class="quiet small">
        {texts.viewsNote} {rig.n_views !== null && rig.views.length < rig.n_views && texts.viewsLeftOut(rig.views.length, rig.n_views)}
      </p>
      <div class="long" tabIndex={0} role="region" aria-label={texts.views}>
        <table class="shares" data-table="views">
          <thead>
            <tr>
              <th scope="col">{texts.view}</th>
              {rig.cameras.map((camera, i) => <th scope="col" key={camera.name}><Swatch i={i} />{camera.name}</th>)}
              <th scope="col">{texts.rms}</th>
            </tr>
          </thead>
          <tbody>
            {rig.views.map((row) => (
              <tr key={row.view} aria-selected={row.view === view}>
                <th scope="row"><button aria-pressed={row.view === view} onClick={() => choose(row.view === view ? null : row.view)}>{row.view}</button></th>
                {row.cells.map((cell, i) => <Share key={i} cell={cell} camera={rig.cameras[i]?.name ?? ""} view={row.view} />)}
                <td>{rms(row.all.rms_px)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Share({ cell, camera, view }: { cell: SeenCell | null; camera: string; view: string }) {
  if (!cell) return <td />;
  const { n_used, n_seen, rms_px } = cell;
  const percent = n_used === n_seen ? "100" : fixed(Math.min(99, (100 * n_used) / Math.max(1, n_seen)), 0);
  const title = texts.cell(camera, view, n_used, n_seen, rms_px === null ? "" : texts.cellRms(fixed(rms_px, 2)));
  return <td class={`share-${tenths(cell)}`} title={title}>{percent}</td>;
}

export function Pairs({ rig }: { rig: RigView }) {
  if (rig.pairs.length === 0) return null;
  return (
    <section class="section">
      <h2>{texts.pairs}</h2>
      <p class="quiet small">{texts.pairsNote}</p>
      <div class="wide" tabIndex={0} role="region" aria-label={texts.pairs}>
        <table data-table="pairs">
          <thead><tr><th scope="col">{texts.pair}</th><th scope="col">{texts.shared}</th><th scope="col">{texts.apart}</th><th scope="col">{texts.between}</th></tr></thead>
          <tbody>
            {rig.pairs.map((pair) => (
              <tr key={`${pair.a}\n${pair.b}`}>
                <th scope="row">{pair.a} – {pair.b}</th>
                <td>{pair.n_shared_views_used === null ? pair.n_shared_views : used(pair.n_shared_views_used, pair.n_shared_views)}</td>
                <td class="lines">{plusMinus(pair.distance_m, pair.distance_sigma_m, MM, "mm")}</td>
                <td class="lines">{plusMinus(pair.angle_rad, pair.angle_sigma_rad, DEG, "°", 3)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {0 < rig.n_pairs_left_out && <p class="quiet small">{texts.pairsLeftOut(rig.n_pairs_left_out)}</p>}
    </section>
  );
}

export function Rejected({ rig }: { rig: RigView }) {
  if (rig.n_seen === null) return null;
  return (
    <section class="section">
      <h2>{texts.rejected}</h2>
      {rig.rejected.length === 0 ? <p class="quiet">{texts.nothingRejected}</p> : (
        <>
          <p class="quiet small">{texts.rejectedNote}</p>
          <div class="long" tabIndex={0} role="region" aria-label={texts.rejected}>
            <table data-table="rejected">
              <thead><tr><th scope="col">{texts.what}</th><th scope="col">{texts.off}</th><th scope="col">{texts.reason}</th></tr></thead>
              <tbody>
                {rig.rejected.map((row, i) => (
                  <tr key={i}>
                    <th scope="row">{[row.camera, row.view, row.target, texts.kinds[row.kind] ?? row.kind, row.id].filter(Boolean).join(" · ")}</th>
                    <td class="lines">{row.residual_px === null ? "–" : `${fixed(row.residual_px, 1)} px`}</td>
                    <td class="text">{row.reason}</td>
                  </tr>
                ))}
              </tbody>
            </table>
          </div>
          {0 < rig.n_rejected_left_out && <p class="quiet small">{texts.rejectedLeftOut(rig.n_rejected_left_out)}</p>}
        </>
      )}
    </section>
  );
}
