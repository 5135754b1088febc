"""Runs every judge: other people's programs read the files Resight writes. Exit 1 when one of them disagrees.

    python scripts/judges/run.py [FOLDER]      default: testdata/formats/golden/rigs

Each judge is a script of its own here, one a program; what it needs is in requirements.txt beside it.
"""

import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
judges = sorted(p for p in HERE.glob("*.py") if p.name != "run.py" and not p.name.startswith("_"))
failed = [p.name for p in judges if subprocess.run([sys.executable, str(p), *sys.argv[1:]], check=False).returncode]
print(f"{len(judges) - len(failed)} of {len(judges)} judges agree" + (f"; not {', '.join(failed)}" if failed else ""))
sys.exit(bool(failed))
