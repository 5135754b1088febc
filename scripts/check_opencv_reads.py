"""OpenCV and PyYAML as judges of the calibration files Resight writes.

The golden files are, byte for byte, what the writer writes (a Rust test holds them to it). Each is read here by the
program it is meant for and compared with the example it was made from. Needs opencv-python-headless and PyYAML:

    python scripts/check_opencv_reads.py
"""

import pathlib
import sys

import cv2
import numpy as np
import yaml

EXAMPLES = pathlib.Path(__file__).resolve().parent.parent / "testdata" / "formats"
GOLDEN = EXAMPLES / "golden"

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


def numbers(value):
    """Every leaf of lists; PyYAML (YAML 1.1) leaves text where it does not see a number."""
    return [x for item in value for x in numbers(item)] if isinstance(value, list) else [value]


def check_yaml(name, keys):
    """Each key is a path of names; all values below it must be the example's numbers."""
    example = {"ros.yaml": "ros_plumb_bob.yaml"}.get(name, name)
    ours, theirs = (yaml.safe_load((folder / file).read_text()) for folder, file in ((GOLDEN, name), (EXAMPLES, example)))
    for path in keys:
        a, b = ours, theirs
        for part in path.split("."):
            a, b = a[part], b[part]
        a, b = numbers(a), numbers(b)
        assert all(isinstance(x, (int, float)) for x in a), f"{name}: {path} has text among its numbers: {a}"
        assert np.allclose(a, b, rtol=0, atol=1e-15), f"{name}: {path}: {a} is not {b}"
    print(f"PyYAML {yaml.__version__} reads {name}")


def main():
    check_opencv()
    check_yaml("ros.yaml", ["camera_matrix.data", "distortion_coefficients.data", "image_width", "image_height"])
    models = [f"cam{i}.{key}" for i in range(6) for key in ("intrinsics", "distortion_coeffs", "resolution")]
    check_yaml("kalibr_camchain.yaml", ["cam1.T_cn_cnm1", *models])
    check_yaml("kalibr_imucam.yaml", ["cam0.T_cam_imu", "cam1.T_cn_cnm1"])


if __name__ == "__main__":
    sys.exit(main())
