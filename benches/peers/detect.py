"""Detectors over a sweep of conditions, Resight beside others on the same pictures; prints Markdown tables.

The pictures are drawn by the example bench_detect (its file sweep.rs lists targets and conditions): 1280 x 960, one change to an easy
picture in each cell. A feature counts as found within 2 px of its true place; *wrong* is one further away, or one that is not there.
Errors are root mean squares per axis. NEES is the mean squared error per axis over the stated variance: 1 where the stated sigma is
right (only Resight states one). Times are processor times of one thread, the mean over the rounds and the pictures of a cell.
"""

import argparse
import json
import os
import subprocess
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import cv2
import numpy as np

import curves

NEAR_PX = 2.0


def charuco_board():
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return cv2.aruco.CharucoBoard((10, 7), 0.04, 0.03, dictionary)


def opencv_charuco():
    detector = cv2.aruco.CharucoDetector(charuco_board())

    def run(image):
        corners, ids, _, _ = detector.detectBoard(image)
        return [] if ids is None else [(int(i), 0, *map(float, c.ravel())) for i, c in zip(ids.ravel(), corners)]

    return run


def opencv_tags(border_bits, wanted):
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.markerBorderBits = border_bits
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(dictionary, parameters)

    def run(image):
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None:
            return []
        # Ids that the target does not have would be sorted out by their user too.
        known = [(i, c[0]) for i, c in zip(ids.ravel(), corners) if i in wanted]
        return [(int(i), k, *map(float, c[k])) for i, c in known for k in range(4)]

    return run


def opencv_chessboard(sector_based):
    def run(image):
        if sector_based:
            ok, corners = cv2.findChessboardCornersSB(image, (9, 6))
        else:
            ok, corners = cv2.findChessboardCorners(image, (9, 6))
            if ok:
                criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.01)
                corners = cv2.cornerSubPix(image, corners, (4, 4), (-1, -1), criteria)
        return [(k, 0, *map(float, c.ravel())) for k, c in enumerate(corners)] if ok else []

    return run


def dt_apriltags(wanted):
    from dt_apriltags import Detector

    detector = Detector(families="tag36h11", nthreads=1, quad_decimate=1.0)

    def run(image):
        found = [tag for tag in detector.detect(image) if tag.tag_id in wanted]
        # Its pixel centres lie at halves and its corners start at the bottom left.
        return [(t.tag_id, 3 - k, *map(float, t.corners[k] - 0.5)) for t in found for k in range(4)]

    return run


def aprilgrid():
    from aprilgrid import Detector

    detector = Detector("t36h11")

    def run(image):
        found = detector.detect(image)
        return [(int(t.tag_id), k, *map(float, c)) for t in found for k, c in enumerate(np.reshape(t.corners, (4, 2)))]

    return run


def contenders():
    """Name and function of each peer, by target; those that are not installed are left out."""
    table = {
        "tag": [("OpenCV", lambda: opencv_tags(1, {7})), ("dt-apriltags", lambda: dt_apriltags({7}))],
        "aprilgrid": [("OpenCV", lambda: opencv_tags(2, set(range(36)))), ("aprilgrid", aprilgrid)],
        "charuco": [("OpenCV", opencv_charuco)],
        "chessboard": [("OpenCV", lambda: opencv_chessboard(False)), ("OpenCV SB", lambda: opencv_chessboard(True))],
        "dots": [],
    }
    made = {}
    for target, rows in table.items():
        made[target] = []
        for name, make in rows:
            try:
                made[target].append((name, make()))
            except ImportError as missing:
                print(f"left out: {name} ({missing})\n")
    return made


def timed(run, image, rounds):
    found = run(image)
    start = time.process_time()
    for _ in range(rounds):
        found = run(image)
    return found, 1e3 * (time.process_time() - start) / rounds


def renumbered(found, target, is_ours):
    """The same with other numberings: a chessboard's half a turn on, which is as right where colours cannot tell; the corners of a tag from
    another corner on and the other way round, which is a convention of each library. Ours are numbered as documented."""
    yield found
    if target == "chessboard":
        yield [(53 - i, *rest) for i, *rest in found]
    if target in ("tag", "aprilgrid") and not is_ours:
        for turn in range(4):
            for way in (1, -1):
                yield [(i, (turn + way * c) % 4, *rest) for i, c, *rest in found]


def scored(row, found):
    """True features, found, wrong, squared errors per axis, normalised squared errors."""
    truth = {(i, c): np.array([u, v]) for i, c, u, v in row["truth"]}
    right, wrong, squares, normalised = 0, 0, [], []
    for i, c, u, v, *sigma in found:
        if (i, c) not in truth:
            continue  # Hidden, or nearer to the rim than is counted.
        error = np.array([u, v]) - truth[i, c]
        if NEAR_PX < np.hypot(*error):
            wrong += 1
            continue
        right += 1
        squares.append(0.5 * error @ error)
        if sigma:
            normalised.append(0.5 * error @ error / sigma[0] ** 2)
    return len(truth), right, wrong, squares, normalised


def best_scored(row, found, is_ours):
    scores = [scored(row, numbered) for numbered in renumbered(found, row["target"], is_ours)]
    return max(scores, key=lambda score: score[1])


def cell(rows, results, is_ours):
    """Recall %, wrong, rms, NEES, mean ms of a cell."""
    scores = [best_scored(row, results[row["image"]][0], is_ours) for row in rows]
    total, right, wrong = (sum(score[k] for score in scores) for k in range(3))
    squares, normalised = (np.concatenate([score[k] for score in scores]) for k in (3, 4))
    ms = np.mean([results[row["image"]][1] for row in rows])
    rms = np.sqrt(squares.mean()) if len(squares) else float("nan")
    return 100 * right / max(total, 1), wrong, rms, normalised.mean() if len(normalised) else float("nan"), ms


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", help="path of the example bench_detect")
    parser.add_argument("--folder", default="/tmp")
    parser.add_argument("--count", type=int, default=3, help="pictures of each cell")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--target", help="this one alone")
    parser.add_argument("--alone", action="store_true", help="without the others")
    parser.add_argument("--curves", metavar="FOLDER", help="write pictures of recall and error over size, tilt and blur there")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    folder = f"{options.folder}/sweep_{options.count}"
    if not os.path.exists(f"{folder}/truth.json"):
        subprocess.run([options.program, "draw", folder, str(options.count)], check=True)
    rows = [r for r in json.load(open(f"{folder}/truth.json")) if options.target in (None, r["target"])]
    command = [options.program, "find", folder, str(options.rounds)] + ([options.target] if options.target else [])
    ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    ours = {found["image"]: (found["found"], found["milliseconds"]) for found in ours}
    peers = {} if options.alone else contenders()
    cells = {}
    for target in dict.fromkeys(row["target"] for row in rows):
        of_target = [row for row in rows if row["target"] == target]
        cells |= table(target, of_target, ours, peers.get(target, []), options.rounds, folder)
    if options.curves:
        curves.write(cells, options.curves)


def table(target, rows, ours, peers, rounds, folder):
    """Prints the table of a target; recall % and rms of each cell."""
    results = [("Resight", ours)]
    for name, run in peers:
        found = {row["image"]: timed(run, cv2.imread(f"{folder}/{row['image']}", 0), rounds) for row in rows}
        results.append((name, found))
    print(f"\n### {target}\n")
    names = [name for name, _ in results]
    heads = [f"{name}: recall %, wrong, rms px" + (", NEES" if name == "Resight" else "") + ", ms" for name in names]
    print("| cell | " + " | ".join(heads) + " |")
    print("| --- |" + " ---: |" * len(names))
    cells = {}
    for condition in dict.fromkeys(row["condition"] for row in rows):
        of_cell = [row for row in rows if row["condition"] == condition]
        columns = []
        for name, result in results:
            recall, wrong, rms, nees, ms = cell(of_cell, result, name == "Resight")
            cells[target, name, condition] = (recall, rms)
            middle = f", {nees:.2f}" if name == "Resight" else ""
            columns.append(f"{recall:.1f}, {wrong}, {rms:.3f}{middle}, {ms:.1f}")
        print(f"| {condition} | " + " | ".join(columns) + " |")
    return cells


if __name__ == "__main__":
    main()
