"""A table of four-point views to a table of poses: Resight beside the loops that people write, file to file, in one run; prints a Markdown table.

The views are of a simulated fleet (`make_fleet`), every camera with its own lens and points. Counted is the CPU time of a process (user and
system) from reading to writing, less that of the same program on a thousandth of the rows, divided by the rows: start-up does not count, nor does waiting.
The loops answer with a pose alone; Resight with covariance, probability, χ² and status too.
"""

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path

LOOPS = {
    "pandas, OpenCV solvePnP SQPNP": ("pandas", "opencv"),
    "pandas, PoseLib estimate_absolute_pose": ("pandas", "poselib"),
    "Polars, OpenCV solvePnP SQPNP": ("polars", "opencv"),
    "Polars, PoseLib estimate_absolute_pose": ("polars", "poselib"),
}
PIXELS = [f"{axis}{k}_px" for k in range(4) for axis in "uv"]
POSE = ["rx", "ry", "rz", "x_m", "y_m", "z_m"]


def cameras(path):
    """Name → matrix (3, 3), points (4, 3)."""
    import csv

    import numpy as np

    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            number = lambda name: float(row[name])
            k = np.array([[number("fx_px"), 0, number("cx_px")], [0, number("fy_px"), number("cy_px")], [0, 0, 1]])
            yield row["camera"], (k, np.array([[number(f"{axis}{i}_m") for axis in "xyz"] for i in range(4)]))


def solver(name):
    """A function of matrix, points and pixels that gives three numbers of rotation and three of translation."""
    import numpy as np

    if name == "opencv":
        import cv2

        def solve(k, points, pixels):
            found, rotation, translation = cv2.solvePnP(points, pixels, k, None, flags=cv2.SOLVEPNP_SQPNP)
            return [*rotation.ravel(), *translation.ravel()] if found else [np.nan] * 6

        return solve
    import poselib

    def solve(k, points, pixels):
        camera = {"model": "PINHOLE", "width": 1920, "height": 1080, "params": [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]}
        pose, _ = poselib.estimate_absolute_pose(pixels, points, camera, {}, {})
        return [*pose.q[1:], *pose.t]

    return solve


def loop(table, library, folder, rows):
    """Reads, solves row by row, writes: what this process is started for."""
    import numpy as np

    known, solve, bad = dict(cameras(folder / "cameras.csv")), solver(library), [np.nan] * 6

    def one(camera, numbers):
        pixels = np.array(numbers).reshape(4, 2)
        # Poison would end the loops.
        return solve(*known[camera], pixels) if camera in known and np.all(np.abs(pixels) < 1e6) else bad

    source, out = str(folder / "peers.parquet"), str(folder / "peers-out.parquet")
    if table == "pandas":
        import pandas as pd

        frame = pd.read_parquet(source).head(rows)
        poses = [one(row.camera, [getattr(row, name) for name in PIXELS]) for row in frame.itertuples()]
        pd.concat([frame[["camera", "time_s"]], pd.DataFrame(poses, columns=POSE, index=frame.index)], axis=1).to_parquet(out)
        return
    import polars as pl

    frame = pl.read_parquet(source).head(rows)
    poses = [one(row[0], row[1:]) for row in frame.select("camera", *PIXELS).iter_rows()]
    frame.select("camera", "time_s").hstack(pl.DataFrame(np.array(poses), schema=POSE)).write_parquet(out)


def cpu_s(words):
    """CPU time of a process and those that it waited for."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, 1):
        raise SystemExit(f"{words[0]}: {ended.stderr[-2000:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def per_row_us(words_of, rows):
    return 1e6 * (cpu_s(words_of(rows)) - cpu_s(words_of(max(1, rows // 1000)))) / (rows - max(1, rows // 1000))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the program resight")
    parser.add_argument("day", type=Path, help="a folder of make_fleet")
    parser.add_argument("--rows", type=int, default=1_000_000, help="for Resight; a twentieth for each loop")
    parser.add_argument("--folder", type=Path, default=Path("."))
    parser.add_argument("--loop", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.loop:
        loop(given.loop[0], given.loop[1], given.day, int(given.loop[2]))
        return
    import pyarrow.parquet as pq

    whole = pq.ParquetFile(next((given.day / "views").glob("*.parquet"))).read().slice(0, given.rows)
    few = given.day / "few.parquet"
    pq.write_table(whole, given.day / "peers.parquet", row_group_size=1 << 20)
    pq.write_table(whole.slice(0, len(whole) // 1000), few)
    out = str(given.day / "peers-out.parquet")
    words = lambda n: [given.program, "batch", str(given.day / "peers.parquet" if n == len(whole) else few), "--cameras",
                       str(given.day / "cameras.csv"), "--sigma-px", "0.3", "--threads", "1", "-q", "-o", out]
    ours = per_row_us(words, len(whole))
    print(f"{len(whole)} rows; CPU time a row, reading and writing included\n")
    print("| | µs | times ours |\n| --- | ---: | ---: |")
    print(f"| resight batch, one thread | {ours:.2f} | 1 |")
    for name, (table, library) in LOOPS.items():
        me = lambda n, t=table, library=library: [sys.executable, __file__, given.program, str(given.day), "--loop", t, library, str(n)]
        theirs = per_row_us(me, len(whole) // 20)
        print(f"| {name} | {theirs:.1f} | {theirs / ours:.0f} |")
    for path in (few, given.day / "peers.parquet", Path(out)):
        path.unlink(missing_ok=True)


if __name__ == "__main__":
    os.environ["OPENCV_FOR_THREADS_NUM"] = "1"
    main()
