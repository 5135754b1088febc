"""fSpy's JSON: pixels from its own definitions (image plane, relative focal length, viewTransform), restated."""

import json
import math

import numpy as np

from _rigs import folder, judge

data = json.loads((folder() / "fspy" / "fspy.json").read_text())
w, h = data["imageWidth"], data["imageHeight"]
view = np.array(data["viewTransform"]["rows"])
assert np.allclose(view @ np.array(data["cameraTransform"]["rows"]), np.eye(4), atol=1e-14)
assert math.isclose(data["horizontalFieldOfView"], 2 * math.atan(max(1.0, 0) / data["relativeFocalLength"]), rel_tol=1e-12)


def to_pixel(plane):
    """Image plane (origin in the middle, y up, half the longer side long) to pixels counted from the first's centre."""
    half = 0.5 * max(w, h)
    return 0.5 * w + half * plane[0] - 0.5, 0.5 * h - half * plane[1] - 0.5


def pixel(camera, x):
    p = view @ np.array([*x, 1.0])
    f, c = data["relativeFocalLength"], data["principalPoint"]
    return to_pixel((c["x"] - f * p[0] / p[2], c["y"] - f * p[1] / p[2]))


# Square pixels: fy = 702.5 is written as fx = 702.25, 0.11 px at the edge.
judge("fSpy's definitions restated", "placed_rig", pixel, tolerance_px=0.12, cameras=["right"])

# A point far out along a world axis lies at its vanishing point.
for i, point in enumerate(data["vanishingPoints"]):
    far = pixel("right", [1e9 if j == i else 0.0 for j in range(3)])
    assert np.allclose(far, to_pixel((point["x"], point["y"])), rtol=1e-4, atol=1e-2), (i, far)
print("fSpy's vanishing points are where its axes meet")
