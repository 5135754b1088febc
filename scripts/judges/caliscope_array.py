"""Caliscope loads its camera_array.toml (its package where installed, else its loader restated) and OpenCV projects."""

import tomllib

from _rigs import folder, judge, opencv_pixel

path = folder() / "caliscope" / "camera_array.toml"
names = ["left", "right", "tele"]
try:
    from caliscope.cameras.camera_array import CameraArray

    array = CameraArray.from_toml(path)
    cameras = {names[n]: array.cameras[n] for n in array.cameras}
    program = "Caliscope"

    def pixel(camera, x):
        c = cameras[camera]
        return opencv_pixel(c.matrix, c.distortions, c.rotation, c.translation, x, c.fisheye)

except ImportError:
    tables = tomllib.loads(path.read_text())["cameras"]
    cameras = {names[int(key)]: table for key, table in tables.items()}
    program = "Caliscope's loader, restated"

    def pixel(camera, x):
        c = cameras[camera]
        return opencv_pixel(c["matrix"], c["distortions"], c["rotation"], c["translation"], x, c["fisheye"])


judge(program, "placed_rig", pixel)
