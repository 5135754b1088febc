"""PhotonVision's calibration JSON: its classes' keys and types restated (they are Java), OpenCV projects.

The poses are not in these files; they come from our mrcal files' golden of the same rig.
"""

import ast
import json

from _rigs import folder, judge, opencv_pixel


def matrix(value):
    """JsonMatOfDouble: rows, cols, type CV_64FC1, data of that many numbers."""
    assert set(value) == {"rows", "cols", "type", "data"} and value["type"] == 6, value
    assert len(value["data"]) == value["rows"] * value["cols"]
    return value["data"]


def pose(camera):
    rt = ast.literal_eval((folder() / "mrcal" / f"{camera}.cameramodel").read_text())["extrinsics"]
    return rt[:3], rt[3:]


def check(shape, distortion, other_keys):
    def pixel(camera, x):
        c = json.loads((folder() / shape / f"{camera}.json").read_text())
        assert set(c) == {"resolution", "cameraIntrinsics", distortion, *other_keys}, set(c)
        assert set(c["resolution"]) == {"width", "height"}
        return opencv_pixel(matrix(c["cameraIntrinsics"]), matrix(c[distortion]), *pose(camera), x)

    judge(f"PhotonVision's classes restated, {shape}", "placed_rig", pixel)


new = ["observations", "calobjectWarp", "calobjectSize", "calobjectSpacing", "lensmodel"]
check("photonvision", "distCoeffs", new)
check("photonvision_old", "cameraExtrinsics", ["perViewErrors", "standardDeviation"])
