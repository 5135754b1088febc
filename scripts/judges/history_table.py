"""pyarrow as the judge of the Parquet tables that `resight history --export` writes.

    python scripts/judges/history_table.py [FILE.parquet]

Without a file (or with a folder, as judges of camera files are given) it is testdata/history/frames.parquet, byte for byte what the writer
writes. Every cell must be that of the CSV of the same name beside it, numbers to the last bit; every column must have the type that its
values need; where there is no value there must be null. Needs pyarrow.
"""

import csv
import pathlib
import sys

import pyarrow as pa
import pyarrow.parquet as pq

DEFAULT = pathlib.Path(__file__).resolve().parents[2] / "testdata" / "history" / "frames.parquet"
TEXT = {"camera", "target", "state", "reason", "event", "detail"}
WHOLE = {"session", "frames", "readings"}


def wanted(name, text):
    """The value of a cell of the CSV."""
    if text == "":
        return None
    return text if name in TEXT else int(text) if name in WHOLE else float(text)


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
