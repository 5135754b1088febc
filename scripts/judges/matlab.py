"""OpenCV projects with MATLAB's parameters, converted as `cameraIntrinsicsToOpenCV` and `stereoParametersToOpenCV` document: our pixels.

K is the transpose of IntrinsicMatrix with 1 less in the principal point; k1 k2 p1 p2 k3 of both lists; R the transpose of
RotationOfCamera2; millimetres.
"""

import json

import numpy as np
import yaml

from _rigs import GOLDEN, judge, opencv_pixel

EXAMPLES = GOLDEN.parents[1]


def opencv(c):
    k = np.array(c["IntrinsicMatrix"]).T if "IntrinsicMatrix" in c else np.array(c["K"], float)
    k[:2, 2] -= 1
    radial = c["RadialDistortion"]
    return k, [*radial[:2], *c["TangentialDistortion"], *radial[2:]]


one = opencv(json.loads((EXAMPLES / "matlab_camera.json").read_text()))
pair = yaml.safe_load((EXAMPLES / "matlab_stereo.yaml").read_text())["stereoParams"]
cameras = {"camera1": opencv(pair["CameraParameters1"]), "camera2": opencv(pair["CameraParameters2"])}
r, t = np.array(pair["RotationOfCamera2"]).T, np.array(pair["TranslationOfCamera2"]) / 1000
poses = {"camera1": (np.eye(3), np.zeros(3)), "camera2": (r, t)}
judge("OpenCV, MATLAB camera", "matlab_camera.json", lambda _, x: opencv_pixel(*one, np.eye(3), np.zeros(3), x), file="pixels_files")
judge("OpenCV, MATLAB pair", "matlab_stereo.yaml", lambda c, x: opencv_pixel(*cameras[c], *poses[c], x), file="pixels_files")
