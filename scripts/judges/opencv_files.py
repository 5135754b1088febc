"""OpenCV reads our YAML and XML, number by number, and its own projection through them gives our pixels.

The golden files are, byte for byte, what the writer writes (a Rust test holds them to it). The single files are compared
with the examples they were made from; the stereo files also by projecting points of the first camera's frame.
"""

import numpy as np

import cv2

from _rigs import GOLDEN as RIGS
from _rigs import folder, judge, opencv_pixel

GOLDEN = RIGS.parent
EXAMPLES = GOLDEN.parent

# golden file, the example it was made from, and {key in the golden: key in the example}
OPENCV = [
    ("opencv_stereo.yml", "opencv_stereo.yml", {k: k for k in ("M1", "D1", "M2", "D2", "R", "T")}),
    (
        "opencv_single.yml",
        "opencv_single.yml",
        {k: k for k in ("camera_matrix", "distortion_coefficients", "image_width", "image_height")},
    ),
    (
        "opencv_fisheye.yml",
        "opencv_fisheye.xml",
        {
            "camera_matrix": "Camera_Matrix",
            "distortion_coefficients": "Distortion_Coefficients",
            "image_width": "image_Width",
            "image_height": "image_Height",
        },
    ),
]


def opencv_value(path, key):
    """Matrix as a flat array, or a number, as OpenCV itself reads it."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), f"OpenCV does not open {path}"
    node = storage.getNode(key)
    assert not node.empty(), f"{path}: OpenCV does not see {key}"
    return np.ravel(node.mat()) if node.isMap() else np.array([node.real()])


def check_opencv():
    for golden, example, keys in OPENCV:
        for ours, theirs in keys.items():
            a, b = opencv_value(GOLDEN / golden, ours), opencv_value(EXAMPLES / example, theirs)
            assert a.shape == b.shape and np.array_equal(a, b), f"{golden}: {ours}: {a} is not {b}"
        print(f"OpenCV {cv2.__version__} reads {golden}")


def check_stereo(path):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), f"OpenCV does not open {path}"
    mat = lambda key: storage.getNode(key).mat()
    assert storage.getNode("camera_name2").string() == "M2", "the second camera's name"
    poses = {"M1": (np.eye(3), np.zeros(3)), "M2": (mat("R"), mat("T"))}
    lenses = {"M1": (mat("M1"), mat("D1")), "M2": (mat("M2"), mat("D2"))}

    def pixel(camera, x):
        return opencv_pixel(*lenses[camera], *poses[camera], x)

    judge(f"OpenCV {cv2.__version__}, {path.name}", "opencv_stereo.yml", pixel, file="pixels_files")


check_opencv()
check_stereo(folder() / "opencv_yaml" / "stereo.yml")
check_stereo(folder() / "opencv_xml" / "stereo.xml")
