"""One answer, whichever engine: embedded, Spark in one process, a real standalone cluster of Spark, and Sail, row for row, bit for bit.

Run by scripts/cluster_tests.sh, which makes two environments: PySpark, and Sail with the client that it needs (RESIGHT_SAIL_PYTHON).
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import resight

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(HERE.parent / "tests"))
import fleet_data  # noqa: E402, beside the other tests

SAIL = os.environ.get("RESIGHT_SAIL_PYTHON", "")
HAS_SAIL = pytest.mark.skipif(not SAIL, reason="RESIGHT_SAIL_PYTHON names no interpreter with pysail")


def environment(**also):
    import pyspark

    home = os.path.dirname(pyspark.__file__)
    return {**os.environ, "SPARK_HOME": home, "PYSPARK_PYTHON": sys.executable, "SPARK_LOCAL_IP": "127.0.0.1", "SPARK_DAEMON_MEMORY": "384m", **also}


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """Views, skewed views, images; the embedded answers."""
    folder = tmp_path_factory.mktemp("engines")
    table = fleet_data.write(folder)
    (folder / "skew").mkdir()
    of_one = table.filter(pa.compute.equal(table["camera"], "cam-0"))
    skew = pa.concat_tables([table] + [of_one] * 5)
    skew = skew.set_column(2, "view", pa.array([f"s{i:06d}" for i in range(len(skew))]))
    assert 0.4 < pa.compute.equal(skew["camera"], "cam-0").to_pandas().mean()
    pq.write_table(skew, folder / "skew" / "0.parquet")
    photo = ROOT / "examples" / "photo"
    (folder / "lenses").mkdir()
    (folder / "lenses" / "left.yml").write_text((photo / "left.yml").read_text())
    (folder / "board.toml").write_text((photo / "board.toml").read_text())
    files = [photo / "left01.jpg", photo / "left03.jpg", folder / "board.toml", folder / "none.jpg"]
    images = [path.read_bytes() if path.exists() else None for path in files]
    (folder / "images").mkdir()
    pq.write_table(pa.table({"camera": ["left", "left", "left", "nobody"], "view": ["a", "b", "c", "d"], "time_s": [0.0, 1.0, 2.0, 3.0],
                             "image": pa.array(images, pa.binary()), "path": [str(path) for path in files]}), folder / "images" / "0.parquet")
    embedded = folder / "embedded"
    embedded.mkdir()
    given = {"sigma_px": 0.3}
    resight.batch(folder / "views", folder / "cameras.csv", embedded / "solve.parquet", drift=embedded / "drift.jsonl", **given)
    resight.batch(folder / "skew", folder / "cameras.csv", embedded / "skew.parquet", **given)
    return folder


def rows(path):
    """By name of the view, every double as its bits."""
    bits = lambda x: x.hex() if isinstance(x, float) else x
    found = [{name: bits(value) for name, value in row.items()} for row in pq.read_table(path).to_pylist()]
    return sorted(found, key=lambda row: row["view"])


def run(python, engine, master, data, **also):
    ended = subprocess.run([python, str(HERE / "engine_job.py"), engine, master, str(data)], env=environment(**also), capture_output=True, text=True,
                           check=False, timeout=600)
    assert ended.returncode == 0, ended.stdout[-2000:] + ended.stderr[-4000:]
    return data / (engine + "-" + "".join(c if c.isalnum() else "-" for c in master))


def compare(out, data):
    assert rows(out / "solve.parquet") == rows(data / "embedded" / "solve.parquet")
    assert rows(out / "skew.parquet") == rows(data / "embedded" / "skew.parquet")
    lines = pq.read_table(out / "drift.parquet")["answer"].to_pylist()
    assert sorted(lines) == sorted((data / "embedded" / "drift.jsonl").read_text().splitlines())
    whole = {row["view"]: row for row in rows(data / "embedded" / "solve.parquet")}
    thin = rows(out / "thin.parquet")
    assert len(thin) == 3 and all(row == whole[row["view"]] for row in thin)
    nothing = pq.read_table(out / "nothing.parquet")
    assert len(nothing) == 0 and "cam_from_target_qw" in nothing.column_names


def compare_images(out):
    from_bytes, from_paths = rows(out / "bytes.parquet"), rows(out / "paths.parquet")
    assert [row["status"] for row in from_bytes] == ["ok", "ok", "error", "error"]
    assert "PNG or JPEG" in from_bytes[2]["reason"] and "not among the cameras" in from_bytes[3]["reason"]
    assert [row["status"] for row in from_paths] == ["ok", "ok", "error", "error"] and from_paths[:2] == from_bytes[:2]
    return from_bytes[:2]


@pytest.fixture(scope="session")
def local(data):
    return run(sys.executable, "spark", "local[2]", data)


def test_spark_in_one_process_is_embedded(local, data):
    compare(local, data)


def test_images_on_workers_are_those_of_this_process(local, data):
    poses = compare_images(local)
    photo = ROOT / "examples" / "photo"
    camera = resight.read_camera(photo / "left.yml")
    for name, row in zip(("left01.jpg", "left03.jpg"), poses):
        answer = resight.locate_image(photo / name, camera, resight.read_target(photo / "board.toml"))
        t = [float.fromhex(row[f"cam_from_target_{axis}_m"]) for axis in "xyz"]
        assert t == list(answer.cam_from_target.translation_m) and float.fromhex(row["chi2"]) == answer.chi2


@HAS_SAIL
def test_sail_is_embedded(data):
    out = run(SAIL, "sail", "local", data)
    compare(out, data)
    compare_images(out)


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def children(pid):
    """Processes below one, by /proc."""
    found, parents = [], {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except OSError:
                continue  # It has ended meanwhile.
    stack = [pid]
    while stack:
        parent = stack.pop()
        below = [child for child, of in parents.items() if of == parent]
        found += below
        stack += below
    return found


def words(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


@pytest.fixture(scope="session")
def standalone(tmp_path_factory):
    """A master and two workers on loopback: their address and process numbers."""
    folder, port = tmp_path_factory.mktemp("standalone"), free_port()
    env, logs = environment(), []
    start = lambda *words, name: subprocess.Popen(
        [env["SPARK_HOME"] + "/bin/spark-class", *words], env=env, stdout=logs.append(open(folder / name, "w")) or logs[-1], stderr=subprocess.STDOUT)
    master = start("org.apache.spark.deploy.master.Master", "--host", "127.0.0.1", "--port", str(port), "--webui-port", "0", name="master.log")
    url = f"spark://127.0.0.1:{port}"
    workers = [start("org.apache.spark.deploy.worker.Worker", "-c", "1", "-m", "1g", "--host", "127.0.0.1", "--webui-port", "0", "-d", str(folder / f"w{i}"),
                     url, name=f"worker{i}.log") for i in range(2)]
    deadline = time.monotonic() + 180
    while (folder / "master.log").read_text().count("Registering worker") < 2:
        assert time.monotonic() < deadline, (folder / "master.log").read_text()[-2000:]
        time.sleep(0.5)
    yield url, [worker.pid for worker in workers]
    for process in [*workers, master]:
        process.terminate()
        process.wait(timeout=60)
    for log in logs:
        log.close()


def test_a_cluster_is_embedded(standalone, data):
    out = run(sys.executable, "spark", standalone[0], data)
    compare(out, data)
    compare_images(out)


def test_an_executor_that_is_killed_amid_a_job_loses_nothing(standalone, data, tmp_path):
    url, workers = standalone
    sign = tmp_path / "running"
    job = subprocess.Popen([sys.executable, str(HERE / "engine_job.py"), "spark", url, str(data)], env=environment(RESIGHT_TEST_SIGN=str(sign)),
                           stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while not sign.exists():
        assert job.poll() is None, job.stdout.read()[-4000:]
        time.sleep(0.1)
    executors = [pid for worker in workers for pid in children(worker) if "CoarseGrainedExecutorBackend" in words(pid)]
    assert len(executors) == 2, "both workers take part"
    os.kill(executors[0], signal.SIGKILL)
    said, _ = job.communicate(timeout=600)
    assert job.returncode == 0, said[-4000:]
    out = data / ("spark-" + "".join(c if c.isalnum() else "-" for c in url))
    assert rows(out / "killed.parquet") == rows(data / "embedded" / "solve.parquet")


def test_the_program_asks_the_cluster(standalone, data, tmp_path):
    url, _ = standalone
    (tmp_path / "views").mkdir()
    for path in (data / "views").iterdir():
        (tmp_path / "views" / path.name).write_bytes(path.read_bytes())
    (tmp_path / "views" / "broken.parquet").write_bytes(b"PAR1 and nothing that is true PAR1")
    words = ["batch", str(tmp_path / "views"), "--cameras", str(data / "cameras.csv"), "--sigma-px", "0.3", "--engine", "spark", "--master", url,
             "-o", str(tmp_path / "poses"), "--drift", str(tmp_path / "drift.jsonl"), "--json"]
    ended = subprocess.run([sys.executable, "-m", "resight", *words], env=environment(), capture_output=True, text=True, check=False, timeout=600)
    assert ended.returncode == 2, ended.stderr[-4000:]  # A file that is none counts more than the poison rows.
    answer = json.loads(ended.stdout)
    assert "broken.parquet" in answer["failed"][0]["file"] and len(answer["failed"]) == 1
    assert rows(tmp_path / "poses") == rows(data / "embedded" / "solve.parquet")
    assert (tmp_path / "drift.jsonl").read_text() == (data / "embedded" / "drift.jsonl").read_text()
    assert answer["rows"] == len(rows(tmp_path / "poses")) and answer["statuses"]["error"] == 4
    again = subprocess.run([sys.executable, "-m", "resight", *words], env=environment(), capture_output=True, text=True, check=False, timeout=600)
    assert again.returncode == 2, "a folder that is there is not written over"


def test_columns_that_are_missing_are_named_before_any_work(data):
    """Without a cluster: the columns of a DataFrame are all that is asked."""
    class Frame:
        dtypes = [("camra", "string"), ("u0_px", "double"), ("v0_px", "double")]

    with pytest.raises(resight.Error, match="did you mean `camra`"):
        resight.spark.solve(Frame(), data / "cameras.csv")
    Frame.dtypes = [("camera", "string"), *((name, "double") for name in ("x_m", "y_m", "z_m", "u_px", "v_px"))]
    with pytest.raises(resight.Error, match="collect_list"):
        resight.spark.solve(Frame(), data / "cameras.csv")
    Frame.dtypes = [("camera", "string"), ("image", "int")]
    with pytest.raises(resight.Error, match="binary"):
        resight.spark.locate(Frame(), data / "cameras.csv", resight.read_target(ROOT / "examples/photo/board.toml"))
