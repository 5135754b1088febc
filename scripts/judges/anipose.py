"""aniposelib loads its TOML and projects; where it is not installed (it needs numba, scipy, pandas) its loader restated.

The restatement: tables other than `metadata` in the order of their sorted names; matrix, distortions, rotation
(Rodrigues) and translation go into cv2.projectPoints as they are.
"""

import tomllib

import numpy as np

from _rigs import folder, judge, opencv_pixel

path = folder() / "aniposelib" / "calibration.toml"
try:
    from aniposelib.cameras import CameraGroup

    group = CameraGroup.load(str(path))
    cameras = {camera.get_name(): camera for camera in group.cameras}
    names = [camera.get_name() for camera in group.cameras]
    program = "aniposelib"

    def pixel(camera, x):
        return cameras[camera].project(np.array([x])).ravel()

except ImportError:
    tables = tomllib.loads(path.read_text())
    cameras = {tables[key]["name"]: tables[key] for key in sorted(tables) if key != "metadata"}
    names = list(cameras)
    program = "aniposelib's loader, restated"

    def pixel(camera, x):
        c = cameras[camera]
        return opencv_pixel(c["matrix"], c["distortions"], c["rotation"], c["translation"], x)


assert names == ["left", "right", "tele"], names
judge(program, "placed_rig", pixel)
