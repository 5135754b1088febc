"""mrcal on the corners of one npz file, intrinsics fixed: run by `rig.py` with the system's Python, which has mrcal. Prints one JSON object."""

import json
import sys
import time

import mrcal
import numpy as np

scene = np.load(sys.argv[1])
rounds = int(sys.argv[2])
pixels, rows, columns = scene["pixels"], int(scene["rows"]), int(scene["columns"])
n_views, n_cameras = pixels.shape[:2]
seen = [(v, c) for v in range(n_views) for c in range(n_cameras) if np.isfinite(pixels[v, c, :, 0]).sum() >= 4]
observations = np.zeros((len(seen), rows, columns, 3))
indices = np.zeros((len(seen), 3), dtype=np.int32)
for i, (v, c) in enumerate(seen):
    of_view = pixels[v, c].reshape(rows, columns, 2)
    missing = np.isnan(of_view[..., 0])
    observations[i, ..., :2] = np.where(missing[..., None], -1.0, of_view)
    observations[i, ..., 2] = np.where(missing, -1.0, 1.0)
    indices[i] = v, c, c - 1


def solve(extrinsics, frames, rejecting=False):
    fixed = dict(do_optimize_intrinsics_core=False, do_optimize_intrinsics_distortions=False, do_optimize_calobject_warp=False)
    quiet = dict(do_apply_outlier_rejection=rejecting, do_apply_regularization=False, verbose=False)
    extrinsics, frames, observed = extrinsics.copy(), frames.copy(), observations.copy()
    started = time.perf_counter()
    mrcal.optimize(
        scene["intrinsics"].copy(), extrinsics, frames, None, observed, indices, None, None,
        lensmodel="LENSMODEL_OPENCV5", imagersizes=scene["sizes"].astype(np.int32),
        calibration_object_spacing=float(scene["spacing_m"]), **fixed, **quiet,
    )
    return time.perf_counter() - started, extrinsics, frames


def fastest(extrinsics, frames, rejecting=False):
    runs = [solve(extrinsics, frames, rejecting) for _ in range(rounds)]
    return min(runs, key=lambda run: run[0])


start = scene["extrinsics"], scene["frames"]
perturbed_s, extrinsics, frames = fastest(*start)
optimum_s, extrinsics, frames = fastest(extrinsics, frames)
rejecting_s, rejecting, _ = fastest(*start, rejecting=True)
columns = lambda rt: np.column_stack([mrcal.Rt_from_rt(rt)[:3], mrcal.Rt_from_rt(rt)[3]])  # [R | t]
poses = lambda extrinsics: [columns(rt).tolist() for rt in extrinsics]
print(json.dumps({
    "perturbed_s": perturbed_s, "optimum_s": optimum_s, "rejecting_s": rejecting_s,
    "cam_from_rig": poses(extrinsics), "rejecting_cam_from_rig": poses(rejecting), "version": "2.2",
}))
