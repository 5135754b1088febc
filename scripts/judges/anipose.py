"""aniposelib loads its TOML and projects; where it is not installed (it needs numba, scipy, pandas) its loader restated.

The restatement: tables other than `metadata` in the order of their sorted names; matrix, distortions, rotation
(Rodrigues) and translation go into cv2.projectPoints as they are.
"""

import tomllib

import numpy as np

from _rigs import folder, judge, opencv_pixel

try:
    from aniposelib.cameras import CameraGroup
except ImportError:
    CameraGroup = None


def loaded(path):
    """Names in the order of loading, and a projection."""
    group = CameraGroup.load(str(path))
    cameras = {camera.get_name(): camera for camera in group.cameras}
    return list(cameras), lambda camera, x: cameras[camera].project(np.array([x])).ravel()


def restated(path):
    tables = tomllib.loads(path.read_text())
    cameras = {tables[key]["name"]: tables[key] for key in sorted(tables) if key != "metadata"}

    def pixel(camera, x):
        c = cameras[camera]
        return opencv_pixel(c["matrix"], c["distortions"], c["rotation"], c["translation"], x, c.get("fisheye", False))

    return list(cameras), pixel


load, program = (loaded, "aniposelib") if CameraGroup else (restated, "aniposelib's loader, restated")
for name, rig, order in (
    ("aniposelib", "placed_rig", ["left", "right", "tele"]),
    ("aniposelib_wide", "placed_wide", ["front", "plain"]),
):
    names, pixel = load(folder() / name / "calibration.toml")
    assert names == order, names
    judge(f"{program}, {name}", rig, pixel, cameras=order)
