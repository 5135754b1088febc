"""A process that `fork` made answers as its parent does, whatever the parent did before."""

import multiprocessing
import subprocess
import sys
import textwrap

import pytest

import resight
from conftest import ROOT

JOBS = {
    "locate_image": 'resight.locate_image(PHOTO + "left01.jpg", camera, board).status',
    "locate_images": 'resight.locate_images([PHOTO + "left01.jpg"] * 3, camera, board)[2].status',
    "detect": 'resight.detect(PHOTO + "left01.jpg", board).status',
    "intrinsics": 'resight.intrinsics(board, PHOTO + "left0*.jpg").status',
    "rig": 'resight.rig_from_images({n: PHOTO + n + ".yml" for n in ("left", "right")}, board,'
           ' {n: PHOTO + n + "*.jpg" for n in ("left", "right")}).status',
    "batch": 'resight.batch("examples/fleet/views.csv", "examples/fleet/cameras.csv", tempfile.mkdtemp() + "/o.parquet").status',
    "undistort": 'str(camera.undistort(np.zeros((480, 640), np.uint8)).shape)',
}
SCRIPT = """
import multiprocessing, sys, tempfile
import numpy as np, resight
PHOTO = "examples/photo/"
camera, board = resight.read_camera(PHOTO + "left.yml"), resight.read_target(PHOTO + "board.toml")

def child(job, queue):
    queue.put(str(eval(job)))

parent = str(eval(sys.argv[1]))
context = multiprocessing.get_context("fork")
for job in sys.argv[2:]:
    queue = context.Queue()
    process = context.Process(target=child, args=(job, queue), daemon=True)
    process.start()
    print(queue.get(timeout=60), flush=True)
    process.join()
"""


@pytest.mark.parametrize("parent", ["locate_image", "locate_images", "rig"])
def test_a_forked_process_answers(parent):
    script = textwrap.dedent(SCRIPT)
    jobs = [JOBS[parent], *JOBS.values()]
    ended = subprocess.run([sys.executable, "-c", script, *jobs], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    answers = ended.stdout.split("\n")[: len(JOBS)]
    here = dict(zip(JOBS, answers))
    assert here["locate_image"] == here["locate_images"] == here["detect"] == here["rig"] == "ok" and here["undistort"] == "(480, 640)"


def located(path):
    camera, board = resight.read_camera("examples/photo/left.yml"), resight.read_target("examples/photo/board.toml")
    return resight.locate_image(path, camera, board).cam_from_target


def test_a_pool_of_processes_returns_poses():
    paths = [f"examples/photo/left0{i}.jpg" for i in (1, 3, 4)]
    here = [located(path) for path in paths]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        there = pool.map(located, paths)
    assert [pose.matrix.tolist() for pose in here] == [pose.matrix.tolist() for pose in there]
