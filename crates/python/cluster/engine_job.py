"""One engine's answers on the data of test_engines.py, in a process of its own: `python engine_job.py ENGINE MASTER FOLDER`.

ENGINE is `spark` (MASTER: local[2] or spark://…) or `sail` (MASTER: a name only; a server is started). Answers go to FOLDER/ENGINE-MASTER/NAME.parquet.
"""

import os
import sys
import time
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq

import resight.spark


def session(engine, master):
    """A session of the engine, and what stops it."""
    from pyspark.sql import SparkSession

    if engine == "sail":
        from pysail.spark import SparkConnectServer

        server = SparkConnectServer("127.0.0.1", 0)
        server.start(background=True)
        _, port = server.listening_address
        made = SparkSession.builder.remote(f"sc://127.0.0.1:{port}").getOrCreate()

        def stop(_server=server):  # It ends with the last that knows it.
            made.stop()
            os._exit(0)  # `server.stop()` waits for ever for clients of its own process.

        return made, stop
    builder = SparkSession.builder.master(master).appName("resight tests")
    for key, value in {
        "spark.ui.enabled": "false", "spark.driver.host": "127.0.0.1", "spark.driver.bindAddress": "127.0.0.1", "spark.driver.memory": "600m",
        "spark.executor.memory": "600m", "spark.sql.shuffle.partitions": "4", "spark.sql.session.timeZone": "UTC",
        "spark.default.parallelism": "4", "spark.sql.execution.arrow.maxRecordsPerBatch": "700", "spark.log.level": "ERROR",
    }.items():
        builder = builder.config(key, value)
    made = builder.getOrCreate()
    return made, made.stop


def answers(spark, folder):
    """Name → DataFrame."""
    cameras, target = str(folder / "cameras.csv"), str(folder / "board.toml")
    solve = lambda df: resight.spark.solve(df, cameras, sigma_px=0.3)
    views = spark.read.parquet(str(folder / "views"))
    poses = solve(views)
    yield "solve", poses
    yield "drift", resight.spark.drift(poses, cameras)
    # Half of the rows are of one camera, and all of those in one partition.
    yield "skew", solve(spark.read.parquet(str(folder / "skew")).repartition(3, "camera"))
    # More partitions than rows: empty ones, and some of one row.
    yield "thin", solve(views.limit(3).repartition(8))
    yield "nothing", solve(views.where("camera = 'nobody'"))
    if (folder / "images").exists():
        shots = spark.read.parquet(str(folder / "images"))
        yield "bytes", resight.spark.locate(shots.drop("path"), str(folder / "lenses"), target)
        yield "paths", resight.spark.locate(shots.drop("image"), str(folder / "lenses"), target, image="path")


def slow(sign, batches):
    """Hands rows on, but slowly enough for somebody to kill the worker amid it; the file `sign` says that it is at work."""
    for batch in batches:
        Path(sign).touch()
        time.sleep(0.4)
        yield batch


def main():
    engine, master, folder = sys.argv[1], sys.argv[2], Path(sys.argv[3])
    out = folder / (engine + "-" + "".join(c if c.isalnum() else "-" for c in master))
    out.mkdir(exist_ok=True)
    spark, stop = session(engine, master)
    if "RESIGHT_TEST_SIGN" in os.environ:
        views = spark.read.parquet(str(folder / "views"))
        # Executors do not have the environment of the driver.
        slowed = views.repartition(8, "view").mapInArrow(partial(slow, os.environ["RESIGHT_TEST_SIGN"]), views.schema)
        pq.write_table(resight.spark.solve(slowed, str(folder / "cameras.csv"), sigma_px=0.3).toArrow(), out / "killed.parquet")
    else:
        for name, df in answers(spark, folder):
            pq.write_table(df.toArrow(), out / f"{name}.parquet")
    stop()


if __name__ == "__main__":
    main()
