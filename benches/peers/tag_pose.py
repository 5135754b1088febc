"""A tag image to a pose, Resight against OpenCV, on the same decoded pixels in one run; prints a Markdown table.

The picture: one tag36h11 tag, tilted, 1280 x 960, in front of clutter, 4 x 4 samples per pixel, blur 0.8 px,
noise 2 grey levels. Its corners are known, so accuracy is printed beside the times.
"""

import argparse
import json
import statistics
import subprocess
import time

import cv2
import numpy as np

WIDTH, HEIGHT, OVERSAMPLING, TAG_ID, ROUNDS = 1280, 960, 4, 7, 3
CAMERA = np.array([[1000.0, 0, 639.5], [0, 1000.0, 479.5], [0, 0, 1]])
SIZE_M = 0.1


def picture(seed, corners):
    """Grey image with the tag's black square at `corners` (TL, TR, BR, BL, pixel centres at integers)."""
    rng = np.random.default_rng(seed)
    big = np.full((HEIGHT * OVERSAMPLING, WIDTH * OVERSAMPLING), 150, np.uint8)
    for _ in range(60):  # clutter: dark and light quadrilaterals, the work a detector has in a real room
        centre = rng.uniform([0, 0], [WIDTH, HEIGHT])
        quad = centre + rng.uniform(-60, 60, (4, 2))
        cv2.fillConvexPoly(big, cv2.convexHull((quad * OVERSAMPLING).astype(np.int32)), int(rng.integers(30, 230)))
    cell = 40
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    marker = cv2.aruco.generateImageMarker(dictionary, TAG_ID, 8 * cell)
    marker = np.pad(marker, cell, constant_values=255)
    n = 8 * cell
    source = np.float32([[0, 0], [n, 0], [n, n], [0, n]]) + cell - 0.5
    target = np.float32((np.asarray(corners) + 0.5) * OVERSAMPLING - 0.5)
    warp = cv2.getPerspectiveTransform(source, target)
    size = (big.shape[1], big.shape[0])
    mask = cv2.warpPerspective(np.full_like(marker, 255), warp, size, flags=cv2.INTER_NEAREST)
    drawn = cv2.warpPerspective(marker, warp, size, flags=cv2.INTER_LINEAR)
    big = np.where(mask > 0, drawn // 2 + 50, big)
    image = cv2.resize(big, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), 0.8).astype(float) + rng.normal(0, 2, (HEIGHT, WIDTH))
    return np.clip(image.round(), 0, 255).astype(np.uint8)


def translation_m(edge_px):
    """Where a tag is whose edge is about `edge_px` long."""
    return np.array([0.03, -0.02, CAMERA[0, 0] * SIZE_M / edge_px])


def distance_m(edge_px):
    return float(np.linalg.norm(translation_m(edge_px)))


def true_corners(edge_px):
    """Corners of that tag, tilted by 30 degrees."""
    h = SIZE_M / 2
    points = np.array([[-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]])
    rotation = np.array([0.35, -0.35, 0.2])
    return cv2.projectPoints(points, rotation, translation_m(edge_px), CAMERA, None)[0][:, 0]


def opencv_pose(refinement):
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = refinement
    detector = cv2.aruco.ArucoDetector(dictionary, parameters)
    h = SIZE_M / 2
    points = np.array([[-h, h, 0], [h, h, 0], [h, -h, 0], [-h, -h, 0]])

    def run(image):
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None or TAG_ID not in ids.ravel():
            return None
        found = corners[int(np.flatnonzero(ids.ravel() == TAG_ID)[0])][0]
        cv2.solvePnP(points, found.astype(float), CAMERA, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        return found

    return run


def opencv(function, threads, runs):
    """Median milliseconds and corners of `runs` calls after one to warm up."""

    def run(image):
        cv2.setNumThreads(threads)
        function(image)
        times = []
        for _ in range(runs):
            start = time.perf_counter()
            corners = function(image)
            times.append(1e3 * (time.perf_counter() - start))
        return statistics.median(times), corners

    return run


def error_px(found, truth, offset):
    """Root mean square per axis; the detector's constant pixel-origin offset is not an error here."""
    return float("nan") if found is None or len(found) != 4 else np.sqrt(np.mean((np.asarray(found) - truth - offset) ** 2))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", help="path of the example bench_tag_pose")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--folder", default="/tmp")
    options = parser.parse_args()
    print(f"OpenCV {cv2.__version__}; {WIDTH}x{HEIGHT}, DICT_APRILTAG_36h11; median of {ROUNDS} rounds in turns\n")
    print("| edge px | detector | ms | times Resight's | corner rms px |")
    print("| ---: | --- | ---: | ---: | ---: |")
    for edge in (40, 80, 200):
        truth = true_corners(edge)
        image = picture(edge, truth)
        path = f"{options.folder}/tag_{edge}.png"
        cv2.imwrite(path, image)
        command = [options.program, path, "DICT_APRILTAG_36h11", str(TAG_ID), str(options.runs)]

        def resight(_):
            out = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            assert abs(out["distance_m"] - distance_m(edge)) < 0.01 * distance_m(edge), out
            return out["median_ms"], np.array(out["corners"])

        contenders = [("Resight, 1 thread", resight, 0.0)]
        for threads, label in ((1, "1 thread"), (-1, "default threads")):
            for name, method in (("SUBPIX", cv2.aruco.CORNER_REFINE_SUBPIX), ("APRILTAG", cv2.aruco.CORNER_REFINE_APRILTAG)):
                run = opencv(opencv_pose(method), threads, max(3, options.runs // 10))
                contenders.append((f"OpenCV {name} + IPPE, {label}", run, 0.5 if name == "APRILTAG" else 0.0))
        # In turns, so that whatever else the machine does falls on all alike.
        rounds = [[run(image) for _, run, _ in contenders] for _ in range(ROUNDS)]
        for k, (name, _, offset) in enumerate(contenders):
            ms, base = (statistics.median(r[j][0] for r in rounds) for j in (k, 0))
            print(f"| {edge} | {name} | {ms:.2f} | {ms / base:.1f} | {error_px(rounds[0][k][1], truth, offset):.3f} |")


if __name__ == "__main__":
    main()
