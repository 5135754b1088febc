// Old and new side by side: the reference, where the camera is now, and the reference before.
import type { PoseView, ReferenceView } from "../api/types";
import { liveTexts as texts } from "../texts/live";
import { clock, degrees, metres } from "./format";

const AXES = ["x", "y", "z"];
const ANGLES = ["yaw", "pitch", "roll"];
/** The axis of the camera about which each angle turns. */
const ABOUT = [1, 0, 2];

export function Comparison({ reference, pose }: { reference: ReferenceView; pose: PoseView | null }) {
  const { reference: now, earlier } = reference;
  if (!now) return <p class="quiet">{texts.noReference}</p>;
  const columns = [
    ...(earlier ? [{ name: texts.oldEarlier, pose: earlier.pose, when: dated(earlier.unix_s) }] : []),
    { name: texts.old, pose: now.pose, when: dated(now.unix_s) },
    ...(pose ? [{ name: texts.now, pose, when: "" }] : []),
  ];
  return (
    <div class="comparison" data-target={reference.target}>
      <div class="wide" tabIndex={0} role="region" aria-label={`${texts.sections.reference} ${reference.target}`}>
        <table>
          <caption class="cut">{reference.target}</caption>
          <thead>
            <tr><td />{columns.map((column) => <th key={column.name} scope="col" class="number">{column.name}<br /><span class="small">{column.when}</span></th>)}</tr>
          </thead>
          <tbody>
            {AXES.map((axis, i) => (
              <tr key={axis}><th scope="row">{axis}</th>{columns.map((c) => <td key={c.name} class="number">{metres(c.pose.position_m[i]!, c.pose.sigma_m[i]!)}</td>)}</tr>
            ))}
            {ANGLES.map((name, i) => (
              <tr key={name}><th scope="row">{name}</th>{columns.map((c) => <td key={c.name} class="number">{degrees(c.pose.yaw_pitch_roll_rad[i]!, c.pose.rotation_sigma_rad[ABOUT[i]!]!)}</td>)}</tr>
            ))}
          </tbody>
        </table>
      </div>
      {reference.changed && <p class="small"><span class="quiet">{texts.oldEarlier} → {texts.old}:</span> {reference.changed.words}</p>}
      {reference.now && <p class="small"><span class="quiet">{texts.old} → {texts.now}:</span> {reference.now.words}</p>}
    </div>
  );
}

function dated(unixS: number | null | undefined): string {
  return unixS == null ? texts.given : texts.learned(clock(unixS));
}
