"""What `resight batch --engine spark` starts: a job as JSON in, files of poses on the cluster's side, the answer as the last line of stdout."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable
from importlib import import_module
from typing import Any

from . import _native, spark
from ._error import Error

_ENDINGS = {".csv": "csv", ".jsonl": "json", ".ndjson": "json", ".json": "json"}
_STATUSES = ("ok", "ambiguous", "degenerate", "inconsistent", "implausible")
# A file that cannot be read is reported; the others are solved.
_READ = {"ignoreCorruptFiles": "true"}


def session(master: str | None) -> Any:
    """The session of the environment, or one of this cluster. Raises `Error` where PySpark is missing."""
    # Workers start `python3` of their PATH, which need not have this package.
    os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
    try:
        sql = import_module("pyspark.sql")
    except ImportError:
        raise Error("--engine spark needs PySpark 4 or newer and pyarrow: pip install 'pyspark>=4' 'pandas<3' pyarrow", "request") from None
    builder = sql.SparkSession.builder.appName("resight batch").config("spark.sql.session.timeZone", "UTC")
    return (builder.remote(master) if master and master.startswith("sc://") else builder.master(master) if master else builder).getOrCreate()


def read(session: Any, inputs: Iterable[str]) -> Any:
    """Views of files, folders and patterns of one kind, by the ending of the first."""
    paths = list(inputs)
    kind = _ENDINGS.get(os.path.splitext(paths[0])[1].lower(), "parquet")
    if kind == "csv":
        functions = import_module("pyspark.sql.functions")
        table = session.read.options(header="true", comment="#", ignoreLeadingWhiteSpace="true", ignoreTrailingWhiteSpace="true", **_READ).csv(paths)
        # A cell that holds no number is a missing number, whose row is kept and says so.
        text = ("camera", "view")
        return table.select([name if name in text else functions.expr(f"try_cast(`{name}` AS double)").alias(name) for name in table.columns])
    return session.read.options(**_READ).format(kind).load(paths)


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Solves, writes, counts."""
    known = spark._cameras(job["cameras"], job["target"])
    for remark in known.warnings:
        print(f"warning: {remark}", file=sys.stderr)
    spark_session = session(job["master"])
    try:
        views = read(spark_session, job["inputs"])
        output = job["output"]
        writer = spark.solve(views, known, sigma_px=job["sigma_px"]).write.mode("errorifexists")
        is_csv = output.lower().endswith(".csv")
        writer.option("header", "true").csv(output) if is_csv else writer.parquet(output)
        poses = spark_session.read.option("header", "true").csv(output) if is_csv else spark_session.read.parquet(output)
        counts = {row[0]: row[1] for row in poses.groupBy("status").count().collect()}
        answer = {
            "counts": [counts.pop(status, 0) for status in _STATUSES] + [sum(counts.values())],
            "cameras": len(known),
            "parts": len(poses.inputFiles()),
            "failed": failed(views),
        }
        if job["drift"] is not None:
            if is_csv:
                raise Error("--drift needs poses as Parquet; give -o a folder that does not end in .csv", "request")
            lines = spark.drift(poses, known, period_s=job["period_s"]).select("answer").collect()
            _native.write_atomically(job["drift"], "".join(f"{line}\n" for line in ordered([row[0] for row in lines])))
        return answer
    finally:
        spark_session.stop()


def ordered(lines: list[str]) -> list[str]:
    """Those that moved first, by evidence; then by what is wrong, then by name."""
    found = ("moved", "wrong_map", "dead", "clock", "wandering", "too_few", "unknown", "steady")

    def rank(line: str) -> tuple[int, float, str]:
        answer = json.loads(line)
        return found.index(answer["found"]), -(answer["motion"] or {"chi2": 0.0})["chi2"], answer["camera"]

    return sorted(lines, key=rank)


def failed(views: Any) -> list[tuple[str, str]]:
    """Files of which no row could be read."""
    # Spark writes one slash after `file:` here, and three there.
    files = {_path(name) for name in views.inputFiles()}
    if not files:
        return []
    read = {_path(row[0]) for row in views.select("_metadata.file_path").distinct().collect()}
    return [(name, "no row of it could be read; write the file again, or leave it out") for name in sorted(files - read)]


def _path(name: str) -> str:
    """Returns the path of a `file:` address; other addresses stay as they are."""
    return "/" + name[5:].lstrip("/") if name.startswith("file:") else name


def main() -> int:
    """The job of the command line; 2 where it is refused."""
    try:
        answer = run(json.loads(sys.argv[1]))
    except Error as reason:
        print(f"error: {reason}", file=sys.stderr)
        return 2
    print(json.dumps(answer))
    return 0


if __name__ == "__main__":
    sys.exit(main())
