"""OpenCV's fisheye model with Gyroflow's numbers, and lensfunpy with lensfun's profiles, give our pixels.

lensfun maps a pixel of the undistorted image to that of the photograph, in single precision. The undistorted image has the
profile's focal length (nominal, as no `real-focal` is stated) and the projection of the lens; its middle is (W − 1)/2. The
installed version (0.3) has radii in halves of H − 1 px, later ones and we of H: at these distortions 0.05 px.
"""

import json
import math
import pathlib
import tempfile

import numpy as np

from _rigs import GOLDEN, judge, opencv_pixel, skip

EXAMPLES = GOLDEN.parents[1]

profile = json.loads((EXAMPLES / "gyroflow.json").read_text())["fisheye_params"]
k, d = profile["camera_matrix"], profile["distortion_coeffs"]
judge("OpenCV, Gyroflow", "gyroflow.json", lambda _, x: opencv_pixel(k, d, np.eye(3), np.zeros(3), x, fisheye=True), file="pixels_files")

try:
    import lensfunpy
except ImportError as reason:
    skip(f"lens_profiles.py, lensfun: {reason}")

WIDTH, HEIGHT = 4000, 3000
DIAGONAL_MM = math.hypot(36, 24) / 5
RADIUS = {"Wide": lambda theta: 2 * math.tan(theta / 2)}
with tempfile.TemporaryDirectory() as folder:
    # lensfun 0.3 knows version 1 of the database alone, which has the same elements for distortion.
    file = pathlib.Path(folder) / "lensfun.xml"
    file.write_text((EXAMPLES / "lensfun.xml").read_text().replace('version="2"', 'version="1"'))
    database = lensfunpy.Database(paths=[str(file)], load_common=False, load_bundled=False)
body = database.cameras[0]
lenses = {lens.model: lens for lens in database.lenses}


def pixel(camera, x):
    name, focal = camera.replace("_", " ").rsplit(" ", 1)
    focal_mm = float(focal.removesuffix("mm"))
    theta = math.atan2(math.hypot(x[0], x[1]), x[2])
    radius = RADIUS.get(name, math.tan)(theta) * focal_mm * math.hypot(WIDTH, HEIGHT) / DIAGONAL_MM
    across = math.hypot(x[0], x[1])
    u, v = (0.5 * (side - 1) + radius * part / across for side, part in ((WIDTH, x[0]), (HEIGHT, x[1])))
    modifier = lensfunpy.Modifier(lenses[name], body.crop_factor, WIDTH, HEIGHT)
    modifier.initialize(focal_mm, 8, 10, flags=lensfunpy.ModifyFlags.DISTORTION, scale=1.0)
    return modifier.apply_geometry_distortion(u, v, 1, 1)[0, 0]


judge("lensfunpy, polynomials", "lensfun.xml", pixel, 0.1, ["Poly_three_4mm", "Poly_five_4mm"], file="pixels_files")
judge("lensfunpy, fitted", "lensfun.xml", pixel, 2.0, ["Odd_powers_4mm", "Wide_3mm"], file="pixels_files")
