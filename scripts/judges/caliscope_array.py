"""Caliscope loads its camera_array.toml (its package where installed, else its loader restated) and OpenCV projects."""

import tomllib

from _rigs import folder, judge, opencv_pixel

try:
    from caliscope.cameras.camera_array import CameraArray
except ImportError:
    CameraArray = None


def loaded(path):
    cameras = CameraArray.from_toml(path).cameras
    return {n: (c.matrix, c.distortions, c.rotation, c.translation, c.fisheye) for n, c in cameras.items()}


def restated(path):
    tables = tomllib.loads(path.read_text())["cameras"]
    keys = ("matrix", "distortions", "rotation", "translation", "fisheye")
    return {int(n): tuple(table[key] for key in keys) for n, table in tables.items()}


load, program = (loaded, "Caliscope") if CameraArray else (restated, "Caliscope's loader, restated")
for name, rig, names in (
    ("caliscope", "placed_rig", ["left", "right", "tele"]),
    ("caliscope_wide", "placed_wide", ["front", "plain"]),
):
    cameras = load(folder() / name / "camera_array.toml")

    def pixel(camera, x):
        *numbers, fisheye = cameras[names.index(camera)]
        return opencv_pixel(*numbers, x, fisheye)

    judge(f"{program}, {name}", rig, pixel, cameras=names)
