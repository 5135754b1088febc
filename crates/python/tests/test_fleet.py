"""Fleets from Python: the same rows as the program writes, whatever table they come in; states that merge; errors that say what to do."""

import json
import os
import pickle
import shutil
import subprocess
import sys
import threading

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fleet_data
import resight
from conftest import program


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    fleet_data.write(folder)
    answer = resight.batch(folder / "views", folder / "cameras.csv", folder / "poses.parquet", drift=folder / "drift.jsonl", sigma_px=0.3)
    return folder, answer


def rows(table):
    """Rows as Python values; text for the columns that are dictionaries in one engine and text in another."""
    return pa.table(table).to_pylist()


def test_batch_is_the_program(fleet, tmp_path):
    folder, answer = fleet
    words = ["batch", folder / "views", "--cameras", folder / "cameras.csv", "--sigma-px", 0.3, "-o", tmp_path / "poses.parquet"]
    line = json.loads(program(*words, "--drift", tmp_path / "drift.jsonl")[0])
    assert (tmp_path / "poses.parquet").read_bytes() == (folder / "poses.parquet").read_bytes()
    assert (tmp_path / "drift.jsonl").read_text() == (folder / "drift.jsonl").read_text()
    timed = ("seconds", "rows_per_s", "output")
    assert {k: v for k, v in line.items() if k not in timed} == {k: v for k, v in answer.to_dict().items() if k not in timed}
    assert answer.status == "error" and answer.statuses.error == 4 and 1000 < answer.statuses.ok


def test_every_table_gives_the_rows_of_batch(fleet):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    table = pq.read_table(folder / "views")
    whole = rows(pq.read_table(folder / "poses.parquet"))
    assert rows(resight.solve_views(table, cameras, sigma_px=0.3)) == whole
    assert rows(resight.solve_views(table.to_pandas(), cameras, sigma_px=0.3)) == whole
    numpy = {name: table[name].to_numpy() for name in table.column_names}
    assert rows(resight.solve_views(numpy, cameras, sigma_px=0.3)) == whole
    pixels = np.stack([numpy[f"{axis}{k}_px"] for k in range(4) for axis in "uv"], axis=1)
    lists = {name: numpy[name] for name in ("camera", "time_s", "view")} | {"points_px": pixels.reshape(-1, 4, 2)}
    assert rows(resight.solve_views(lists, cameras, sigma_px=0.3)) == whole
    nested = pa.table({**{name: table[name] for name in ("camera", "time_s", "view")}, "points_px": pa.array(list(pixels), pa.list_(pa.float64()))})
    assert rows(resight.solve_views(nested.slice(5, 100), cameras, sigma_px=0.3)) == whole[5:105]


def test_a_row_a_point_is_put_together(fleet):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    table = pq.read_table(folder / "views").slice(20, 50).to_pandas()
    frames = [table[["camera", "time_s", "view"]].assign(u_px=table[f"u{k}_px"], v_px=table[f"v{k}_px"], k=k) for k in range(4)]
    points = pd.concat(frames).sort_values(["view", "k"])
    for i, axis in enumerate(("x_m", "y_m", "z_m")):
        points[axis] = fleet_data.POINTS_M[points.k, i]
    points = points[points.camera != "cam-2"]
    expected = [row for row in rows(resight.solve_views(table, cameras, sigma_px=0.3)) if row["camera"] != "cam-2"]
    assert rows(resight.solve_views(points.drop(columns="k"), cameras, sigma_px=0.3)) == expected and 30 < len(expected)


def test_an_answer_is_columns_too(fleet):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    poses = resight.solve_views(pq.read_table(folder / "views").slice(0, 20), cameras)
    assert poses.column("status").count("error") == 4 and poses.column("camera")[17] is None
    assert np.isnan(poses.column("chi2")).sum() == 4 and poses.column("chi2").dtype == np.float64
    with pytest.raises(resight.Error, match="no column `chi`"):
        poses.column("chi")


def test_arrays_are_read_where_they_lie_and_others_work_meanwhile(fleet):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    table = pa.concat_tables([pq.read_table(folder / "views")] * 20).combine_chunks()
    ticks, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            ticks[0] += 1
            stop.wait(0.0005)

    counter = threading.Thread(target=count)
    counter.start()
    resight.solve_views(table, cameras)
    stop.set()
    counter.join()
    assert 5 < ticks[0]


def test_states_merge_in_any_order_to_those_of_the_whole(fleet):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    poses = pq.read_table(folder / "poses.parquet")
    whole = resight.FleetState()
    whole.add(poses)
    parts = []
    for first in range(0, len(poses), 500):
        state = resight.FleetState()
        state.add(poses.slice(first, 500))
        parts.append(pickle.loads(pickle.dumps(state)))
    merged = resight.FleetState()
    for part in reversed(parts):
        merged.merge(part)
    assert merged == whole and merged.counts == whole.counts and merged.counts["error"] == 4
    split = resight.FleetState()
    for part in whole.split().values():
        split.merge(resight.FleetState.from_bytes(part))
    assert split.split() == whole.split()
    drift = (folder / "drift.jsonl").read_text().splitlines()
    assert [answer.to_json() for answer in whole.assess(cameras)] == drift
    found = {answer.camera: answer.found for answer in whole.assess(cameras)}
    assert found["cam-1"] == "moved" and found["cam-2"] == "wrong_map" and found["cam-3"] == "dead" and found["cam-0"] == "steady"
    with pytest.raises(resight.Error, match="900 s and 60 s do not mix"):
        whole.merge(resight.FleetState(60))
    for bytes_ in (b"", b"nothing", whole.to_bytes()[:-1], whole.to_bytes() + b"x"):
        with pytest.raises(resight.Error, match="no state of a fleet"):
            resight.FleetState.from_bytes(bytes_)


def test_the_report_is_that_of_the_program(fleet, tmp_path):
    folder, _ = fleet
    answers = resight.fleet_report(folder / "poses.parquet", cameras=folder / "cameras.csv", output=tmp_path / "fleet.html")
    lines = program("fleet-report", folder / "poses.parquet", "--cameras", folder / "cameras.csv", "-o", tmp_path / "program.html")
    assert [answer.to_json() for answer in answers] == lines
    page = (tmp_path / "fleet.html").read_text()
    assert page == (tmp_path / "program.html").read_text() and "cam-1" in page


@pytest.mark.skipif(shutil.which("node") is None, reason="node runs the script of the page")
def test_durations_of_the_report_are_sorted_by_their_length(fleet, tmp_path):
    folder, _ = fleet
    resight.fleet_report(folder / "poses.parquet", cameras=folder / "cameras.csv", output=tmp_path / "fleet.html")
    script = (tmp_path / "fleet.html").read_text().partition("<script>")[2].partition("</script>")[0]
    compare = script[script.index("const seconds"):script.index("for (const head of")]
    cells = ["2.1 h", "53 s", "1.5 days", "4 min", "none needed", "119 s", "6.1 ± 1.4 mm", "2026-05-28 20:26:40 UTC"]
    ended = subprocess.run(["node", "-e", f"{compare}; console.log(JSON.stringify({json.dumps(cells)}.sort(compare)))"], capture_output=True, text=True, check=True)
    expected = ["6.1 ± 1.4 mm", "53 s", "119 s", "4 min", "2.1 h", "1.5 days", "2026-05-28 20:26:40 UTC", "none needed"]
    assert json.loads(ended.stdout) == expected


def test_cameras_travel_whole(fleet, tmp_path):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    again = pickle.loads(pickle.dumps(cameras))
    assert again.names == cameras.names and again.to_text() == cameras.to_text() and len(again) == 6
    (tmp_path / "cameras.csv").write_text("camera,fx_px,fy_px,cx_px,cy_px,k1\na,1000.1,1000.2,639.123456789,479.5,-0.1\n")
    sizeless = resight.Cameras.read(tmp_path / "cameras.csv")
    assert pickle.loads(pickle.dumps(sizeless)).to_text() == sizeless.to_text()
    assert "distortion" in sizeless.warnings[0]


@pytest.mark.parametrize(("change", "message"), [
    (lambda t: t.drop_columns(["camera"]), "no column `camera`"),
    (lambda t: t.rename_columns(["camra" if name == "camera" else name for name in t.column_names]), "did you mean `camra`"),
    (lambda t: t.drop_columns(["v2_px"]), "no column `v2_px`"),
    (lambda t: t.set_column(3, "u0_px", pa.array(["x"] * len(t))), "column `u0_px` is of type string"),
])
def test_columns_that_are_missing_are_named(fleet, change, message):
    folder, _ = fleet
    with pytest.raises(resight.Error, match=message) as caught:
        resight.solve_views(change(pq.read_table(folder / "views").slice(0, 5)), resight.Cameras.read(folder / "cameras.csv"))
    assert caught.value.kind == "input"


def test_columns_of_different_lengths_are_refused(fleet):
    folder, _ = fleet
    cameras = resight.Cameras.read(folder / "cameras.csv")
    table = {"camera": ["cam-0"] * 3, "points_px": np.zeros((2, 8))}
    with pytest.raises(resight.Error, match="column `points_px` has 2 rows and `camera` has 3"):
        resight.solve_views(table, cameras)


def test_a_run_that_is_stopped_is_continued(fleet, tmp_path):
    folder, answer = fleet

    def stop(done, total):
        assert 0 < done <= total
        raise KeyboardInterrupt

    given = folder / "views", folder / "cameras.csv", tmp_path / "poses.parquet"
    with pytest.raises(KeyboardInterrupt):
        resight.batch(*given, sigma_px=0.3, threads=1, progress=stop)
    seen = []
    again = resight.batch(*given, sigma_px=0.3, threads=1, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (answer.rows, answer.rows)
    assert (tmp_path / "poses.parquet").read_bytes() == (folder / "poses.parquet").read_bytes()
    assert again.parts == answer.parts


def varint(n):
    """A whole number as Parquet's footer writes it."""
    n, out = 2 * n, b""
    while 0x7F < n:
        out, n = out + bytes([n & 0x7F | 0x80]), n >> 7
    return out + bytes([n])


@pytest.mark.parametrize("claimed", [2**40, 2**62, 0])
def test_a_file_that_states_more_rows_than_it_can_hold_takes_no_memory(fleet, tmp_path, claimed):
    """Its footer says so many rows wherever it said how many there are."""
    folder, _ = fleet
    table = pq.read_table(folder / "views").slice(0, 613)
    (tmp_path / "views").mkdir()
    pq.write_table(table, tmp_path / "views" / "good.parquet")
    pq.write_table(table, tmp_path / "views" / "liar.parquet", store_schema=False)
    whole = (tmp_path / "views" / "liar.parquet").read_bytes()
    size = int.from_bytes(whole[-8:-4], "little")
    body, footer = whole[: -8 - size], whole[-8 - size : -8]
    assert 2 < footer.count(b"\x16" + varint(613))
    footer = footer.replace(b"\x16" + varint(613), b"\x16" + varint(claimed))
    (tmp_path / "views" / "liar.parquet").write_bytes(body + footer + len(footer).to_bytes(4, "little") + b"PAR1")
    answer = resight.batch(tmp_path / "views", folder / "cameras.csv", tmp_path / "poses.parquet")
    assert answer.rows == 613 and len(answer.failed) == (claimed != 0)
    if claimed:
        assert "liar.parquet" in answer.failed[0].file and "do not fit its" in answer.failed[0].reason


def test_killed_at_two_hundred_instants_the_output_is_that_of_an_undisturbed_run(tmp_path):
    """By SIGKILL, at instants spread over the parts written and over the start, some of them of runs that continue one that was killed."""
    import random
    import time

    fleet_data.write(tmp_path, n=12, files=24, hours=24.0)

    def start(output):
        words = ["batch", "views", "--cameras", "cameras.csv", "--sigma-px", "0.3", "-o", output, "--drift", output + ".jsonl", "-q"]
        code = "import sys; from resight._native import main; sys.exit(main(['resight', *sys.argv[1:]]))"
        return subprocess.Popen([sys.executable, "-c", code, *words], cwd=tmp_path, stdout=subprocess.DEVNULL)

    assert start("whole.parquet").wait() == 1
    read = lambda name: (tmp_path / name).read_bytes()
    whole, drift = read("whole.parquet"), read("whole.parquet.jsonl")
    chance, kills, parts = random.Random(4), 0, 0

    def written():  # The folder goes away when the run is whole.
        try:
            return [name for name in os.listdir(tmp_path / "out.parquet.parts") if name.endswith(".written")]
        except FileNotFoundError:
            return []

    while kills < 200:
        (tmp_path / "out.parquet").unlink(missing_ok=True)
        for _ in range(chance.randint(1, 4)):
            run = start("out.parquet")
            goal = len(written()) + chance.randint(0, 90)
            while run.poll() is None and len(written()) < goal:
                time.sleep(0.001)
            time.sleep(chance.uniform(0.0, 0.01))
            run.kill()
            run.wait()
            kills += 1
            parts += bool(written())
            assert not (tmp_path / "out.parquet").exists() or read("out.parquet") == whole, kills
        assert start("out.parquet").wait() == 1
        assert read("out.parquet") == whole and read("out.parquet.jsonl") == drift, kills
        assert not (tmp_path / "out.parquet.parts").exists()
    assert 100 < parts, f"only {parts} of {kills} kills left parts to continue from"


def test_what_cannot_be_is_refused_before_any_work(fleet, tmp_path):
    folder, _ = fleet
    with pytest.raises(resight.Error, match="sigma_px: -1"):
        resight.batch(folder / "views", folder / "cameras.csv", tmp_path / "x.parquet", sigma_px=-1)
    with pytest.raises(resight.Error, match="nowhere") as caught:
        resight.batch(folder / "views", folder / "nowhere.csv", tmp_path / "x.parquet")
    assert caught.value.kind == "file"
    with pytest.raises(resight.Error, match="this is a folder"):
        resight.batch(folder / "views", folder / "cameras.csv", tmp_path)


def test_a_cluster_without_pyspark_says_how_to_get_it(fleet, tmp_path):
    folder, _ = fleet
    words = ["batch", str(folder / "views"), "--cameras", str(folder / "cameras.csv"), "-o", str(tmp_path / "poses"), "--engine", "spark"]
    code = "import sys; sys.modules['pyspark'] = None; import runpy; runpy.run_module('resight._spark_job', run_name='__main__')"
    job = {"inputs": [str(folder / "views")], "cameras": str(folder / "cameras.csv"), "target": None, "output": str(tmp_path / "poses"),
           "drift": None, "sigma_px": 0.3, "period_s": 900.0, "master": None}
    ended = subprocess.run([sys.executable, "-c", code, json.dumps(job)], capture_output=True, text=True, check=False)
    assert ended.returncode == 2 and "pip install 'pyspark>=4'" in ended.stderr, ended.stderr
    refused = subprocess.run([sys.executable, "-m", "resight", *words, "--threads", "2"], capture_output=True, text=True, check=False)
    assert refused.returncode == 2 and "spark.executor.cores" in refused.stderr
