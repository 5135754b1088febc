"""Prints crates/core/tests/camera_tables/opencv.txt: projections by OpenCV (projectPoints, fisheye.projectPoints).

pip install numpy opencv-python-headless; python camera_opencv.py > ../../../crates/core/tests/camera_tables/opencv.txt
Columns: model | parameters in Resight's order (fx fy cx cy, then OpenCV's coefficients) | x y z | u v.
"""

import cv2
import numpy as np

VGA = [535.4, 535.9, 341.8, 234.2]
TUM_VI = [190.978, 190.973, 254.932, 256.897]
WIDE = [1400.0, 1395.5, 959.5, 539.5]

PLANE = [
    (VGA, [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]),
    (VGA, [-0.26637, -0.03858588, 0.0017831, -0.00028122, 0.23839]),
    (WIDE, [17.9, 11.4, 1e-4, -2e-4, 0.5, 18.3, 17.6, 3.3]),
    (WIDE, [-0.3, 0.12, 1e-3, -2e-3, -0.02, 0.02, 0.01, -0.002, 1e-3, -4e-4, -2e-3, 3e-4]),
    (VGA, [-0.3, 0.12, 1e-3, -2e-3, -0.02, 0.02, 0.01, -0.002, 1e-3, -4e-4, -2e-3, 3e-4, 0.05, -0.08]),
    (WIDE, [-0.1, 0.02, 5e-4, -3e-4, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.35, 0.2]),
]
FISHEYE = [
    (TUM_VI, [0.00348238940, 0.000715034845, -0.00205323614, 0.000202936736]),
    (WIDE, [-0.05, 0.01, -0.02, 0.001]),
    (WIDE, [0.0, 0.0, 0.0, 0.0]),
]


def points(reach):
    grid = np.linspace(-reach, reach, 5)
    depths = [0.7, 1.0, 3.3, 12.0, 0.05]
    plane = [(x + 0.013, 0.8 * y - 0.007) for x in grid for y in grid]
    return np.array([(x * z, y * z, z) for (x, y), z in zip(plane, depths * 5)])


def row(model, matrix, coefficients, point, pixel):
    numbers = [" ".join(repr(float(v)) for v in part) for part in (matrix + coefficients, point, pixel)]
    print(model, *numbers, sep=" | ")


def main():
    print(f"# OpenCV {cv2.__version__}: model | parameters | x y z | u v; made by docs/math/check/camera_opencv.py")
    still = np.zeros(3)
    for project, name, cases, reach in [
        (cv2.projectPoints, "brown_conrady", PLANE, 0.6),
        (None, "kannala_brandt", FISHEYE, 1.5),
    ]:
        for (fx, fy, cx, cy), coefficients in cases:
            k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
            x, d = points(reach), np.array(coefficients)
            if project:
                pixels = project(x, still, still, k, d)[0]
            else:
                pixels = cv2.fisheye.projectPoints(x.reshape(-1, 1, 3), still, still, k, d)[0]
            for point, pixel in zip(x, pixels.reshape(-1, 2)):
                row(name, [fx, fy, cx, cy], coefficients, point, pixel)


main()
