"""pyarrow as the judge of the Parquet tables that `resight history --export` writes.

    python scripts/judges/history_table.py [FILE.parquet]

Without a file (or with a folder, as judges of camera files are given) it is testdata/history/frames.parquet, byte for byte what the writer
writes. Every cell must be that of the CSV of the same name beside it, numbers to the last bit; every column must have the type that its
values need; where there is no value there must be null. A row has the numbers of a pose where it counts readings, those of a turn where it
counts turns, and their scatter where it is of a minute or an hour. Needs pyarrow.
"""

import csv
import pathlib
import sys

import pyarrow as pa
import pyarrow.parquet as pq

DEFAULT = pathlib.Path(__file__).resolve().parents[2] / "testdata" / "history" / "frames.parquet"
TEXT = {"camera", "target", "state", "reason", "event", "detail"}
WHOLE = {"session", "frames", "readings", "turns"}
# What is counted, the numbers that go with it, and those that go with it in minutes and hours; by the beginnings of their names.
PARTS = {
    "readings": (
        ("qw", "qx", "qy", "qz", "x_m", "y_m", "z_m", "rms_px", "max_rms_px", "cov_"),
        ("scatter_", "min_", "max_rx", "max_ry", "max_rz", "max_t"),
    ),
    "turns": (("n_landmarks", "turn_", "cov_turn_"), ("scatter_turn_", "min_turn_", "max_turn_")),
}


def wanted(name, text):
    """The value of a cell of the CSV."""
    if text == "":
        return None
    return text if name in TEXT else int(text) if name in WHOLE else float(text)


def belongs(name, beginnings, counted):
    """Whether a column is one of these; those of turns begin as those of poses do."""
    return name.startswith(beginnings) and (counted == "turns" or "turn" not in name)


def incomplete(table):
    """Numbers that are missing in rows that count them, or there in rows that do not; of how many rows there were numbers."""
    faults, seen = [], {}
    if "turns" not in table.column_names:
        return faults, seen
    spans = table.column("span_s").to_pylist()
    for counted, (always, joined) in PARTS.items():
        counts = table.column(counted).to_pylist()
        seen[counted] = sum(0 < n for n in counts)
        for beginnings, due in ((always, [0 < n for n in counts]), (joined, [0 < n and 0 < s for n, s in zip(counts, spans)])):
            for name in (name for name in table.column_names if belongs(name, beginnings, counted)):
                if [value is not None for value in table.column(name).to_pylist()] != due:
                    faults.append(f"{name} is not where {counted} are")
    return faults, seen


def judge(path):
    """What is wrong with the table; how many cells were compared."""
    table = pq.read_table(path)
    with open(path.with_suffix(".csv"), newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    names = rows[0]
    faults = [] if table.column_names == names else [f"columns {table.column_names}"]
    compared = 0
    for name, column in zip(names, zip(*rows[1:])):
        kind = pa.string() if name in TEXT else pa.int64() if name in WHOLE else pa.float64()
        if table.schema.field(name).type != kind:
            faults.append(f"{name} is {table.schema.field(name).type}, not {kind}")
        values = table.column(name).to_pylist()
        compared += len(values)
        if values != [wanted(name, text) for text in column]:
            faults.append(f"{name} differs from the CSV")
    missing, seen = incomplete(table)
    faults += missing
    if path == DEFAULT and not (seen.get("readings") and seen.get("turns")):
        faults.append("the table has no pose or no turn to judge by")
    return faults, compared


def main():
    given = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT
    path = given if given.suffix == ".parquet" else DEFAULT
    faults, compared = judge(path)
    if compared == 0:
        faults.append("no cells")
    print(f"pyarrow {pa.__version__}: {path.name}, {compared} cells" + "".join(f"\n  {fault}" for fault in faults))
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
