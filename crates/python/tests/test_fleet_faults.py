"""`batch` and `fleet-report` asked for the wrong thing, or given the wrong files: each is named, with the way out."""

import json
import os
import subprocess
import sys

import pyarrow.parquet as pq
import pytest

import fleet_data


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("faults")
    fleet_data.write(made, n=4, hours=1.0)
    (made / "twice.csv").write_text("camera,fx_px,fy_px,cx_px,cy_px\na,900,900,1,1\nb,900,900,1,1\na,900,900,1,1\n")
    (made / "no-camera.csv").write_text("time_s,u0_px,v0_px\n1,2,3\n")
    (made / "no-lens.csv").write_text("camera,fate\na,steady\n")
    return made


def run(folder, *words):
    command = [os.path.join(os.path.dirname(sys.executable), "resight"), *words]
    if not os.path.exists(command[0]):
        command = [sys.executable, "-m", "resight", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)


@pytest.mark.parametrize(("words", "said"), [
    (["views", "--cameras", "camers.csv", "-o", "out.parquet"], ["camers.csv"]),
    (["views", "--cameras", "no-lens.csv", "-o", "out.parquet"], ["fx_px"]),
    (["no-camera.csv", "--cameras", "cameras.csv", "-o", "out.parquet"], ["no column `camera`", "3 or more are needed"]),
    (["nothing-*.parquet", "--cameras", "cameras.csv", "-o", "out.parquet"], ["no file of views"]),
    (["views", "--cameras", "cameras.csv", "-o", "views/0.parquet"], ["one of the inputs"]),
    (["views", "--cameras", "cameras.csv", "-o", "views"], ["this is a folder"]),
    (["views", "--cameras", "cameras.csv", "-o", "o", "--master", "local[2]"], ["--engine spark"]),
    (["views", "--cameras", "cameras.csv", "-o", "o", "--engine", "spark", "--threads", "2"], ["spark.executor.cores"]),
])
def test_what_is_wrong_with_files_and_flags_is_named(folder, words, said):
    ended = run(folder, "batch", *words)
    assert ended.returncode == 2 and all(part in ended.stderr for part in said), ended.stderr


def test_a_camera_that_is_in_the_table_twice_does_not_stop_the_others(folder):
    """The second row is a bad row like others: named with its line, and left out."""
    ended = run(folder, "batch", "views", "--cameras", "twice.csv", "-o", "out-twice.parquet", "--json")
    answer = json.loads(ended.stdout)
    assert ended.returncode == 2 and 0 < answer["rows"] and answer["cameras"] == 2
    assert [failed["reason"].partition("twice.csv")[2][:40] for failed in answer["failed"]] == [":4: column `camera` is `a` as in line 2,"]


def test_a_report_of_views_is_refused(folder):
    ended = run(folder, "fleet-report", "views/0.parquet")
    assert ended.returncode == 2 and "the output of `resight batch` is needed" in ended.stderr


def test_wrong_units_swapped_pixels_and_poison_are_no_answers(folder):
    """u and v exchanged, millimetres on the sensor, empty cells, a camera that nobody knows, an absurd number."""
    row = pq.read_table(folder / "views").to_pylist()[0]
    pixels = [row[f"{axis}{k}_px"] for k in range(4) for axis in "uv"]
    swapped = [pixels[i ^ 1] for i in range(8)]
    cells = lambda numbers: ",".join(str(x) for x in numbers)
    header = "camera,time_s," + ",".join(f"{axis}{k}_px" for k in range(4) for axis in "uv")
    lines = [header, f"cam-0,4,{cells(swapped)}", f"cam-0,3,{cells(x * 3e-3 for x in pixels)}", "cam-0,2,,,,,,,,",
             f"nobody,1,{cells(pixels)}", f"cam-0,nan,1e70,{cells(pixels[1:])}", f"cam-0,0,{cells(pixels)}"]
    (folder / "wrong.csv").write_text("\n".join(lines) + "\n")
    ended = run(folder, "batch", "wrong.csv", "--cameras", "cameras.csv", "--sigma-px", "0.3", "-o", "out.csv", "--json")
    assert ended.returncode == 1, ended.stderr
    out = (folder / "out.csv").read_text().splitlines()[1:]
    assert [",ok," in line for line in out] == [False, False, False, False, False, True]
    assert "is missing or not a number" in out[2] and "not among the cameras" in out[3] and "check the unit" in out[4]
    assert json.loads(ended.stdout)["statuses"]["ok"] == 1


def test_times_that_run_backwards_change_no_answer(folder):
    """The same rows from the last to the first: the same drift."""
    table = pq.read_table(folder / "views")
    (folder / "backwards").mkdir()
    pq.write_table(table.take(list(range(len(table) - 1, -1, -1))), folder / "backwards" / "0.parquet")
    for name in ("views", "backwards"):
        run(folder, "batch", name, "--cameras", "cameras.csv", "--sigma-px", "0.3", "-o", f"{name}.out.parquet", "--drift", f"{name}.jsonl")
    assert (folder / "views.jsonl").read_text() == (folder / "backwards.jsonl").read_text() != ""


def test_explain_says_what_is_there_and_what_is_missing(folder):
    ended = run(folder, "batch", "--explain", "views/0.parquet")
    assert ended.returncode == 0 and "time of the image" in ended.stdout and "u of point 3, px" in ended.stdout
    (folder / "some.csv").write_text("camra,u0_px,v0_px,u1_px\n")
    ended = run(folder, "batch", "--explain", "some.csv", "--json")
    missing = " ".join(json.loads(ended.stdout)["missing"])
    assert ended.returncode == 1 and "did you mean `camra`" in missing and "v1_px" in missing
