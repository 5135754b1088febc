"""mrcal reads the .cameramodel files and projects. mrcal is no wheel: `apt install python3-mrcal`, for Debian's Python."""

import os
import sys

try:
    import mrcal
except ImportError:
    system = "/usr/bin/python3"
    if os.path.exists(system) and os.environ.get("RESIGHT_MRCAL") != "tried":
        os.execve(system, [system, __file__, *sys.argv[1:]], {**os.environ, "RESIGHT_MRCAL": "tried"})
    from _rigs import skip

    skip("mrcal is not installed; `apt install python3-mrcal` lets it read our .cameramodel files")

import numpy as np

from _rigs import folder, judge


def rt_cam_ref(model):
    """mrcal 2.5 renamed extrinsics_rt_fromref."""
    return model.rt_cam_ref() if hasattr(model, "rt_cam_ref") else model.extrinsics_rt_fromref()


models = {path.stem: mrcal.cameramodel(str(path)) for path in (folder() / "mrcal").glob("*.cameramodel")}


def pixel(camera, x):
    model = models[camera]
    return mrcal.project(mrcal.transform_point_rt(rt_cam_ref(model), np.array(x)), *model.intrinsics())


assert tuple(models["left"].imagersize()) == (640, 480)
judge("mrcal", "placed_rig", pixel)
