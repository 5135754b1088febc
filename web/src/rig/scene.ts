// A rig as the 3-D view draws it.
import type { RigView } from "../api/types";
import type { SpaceScene, SpaceTarget, Triple } from "../space/view";

/** Part of the axes' length that a target's own axes are drawn with. */
const TARGET_AXES = 0.5;

/** The whole rig; with a view, only the targets of that view. */
export function sceneOf(rig: RigView, view: string | null): SpaceScene {
  const targets = rig.targets.filter((one) => view === null || one.view === view);
  const seenBy = new Map(rig.views.map((row) => [row.view, row.cells.flatMap((cell, i) => (cell && 0 < cell.n_used ? [i] : []))]));
  const length = TARGET_AXES * rig.axis_m;
  const drawn: SpaceTarget[] = targets.map((one) => {
    const end = (axis: number): Triple => {
      const [x, y, z] = one.position_m;
      const [a, b, c] = one.rotation;
      return [x + length * a[axis]!, y + length * b[axis]!, z + length * c[axis]!];
    };
    return {
      name: one.target,
      position_m: one.position_m,
      outline_m: [end(0), one.position_m, end(1)],
      is_closed: false,
      points_m: [],
      middle_m: one.position_m,
      seen_by: seenBy.get(one.view) ?? [],
      is_strong: view !== null,
    };
  });
  return {
    centre_m: rig.centre_m,
    radius_m: rig.radius_m,
    axis_m: rig.axis_m,
    ellipsoid_magnification: rig.ellipsoid_magnification,
    cameras: rig.cameras.map(({ name, position_m, border_m, half_axes_m }) => ({ name, position_m, border_m, half_axes_m })),
    targets: drawn,
  };
}
