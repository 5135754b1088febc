#!/usr/bin/env bash
# Tests of fleets on engines: Spark in one process, a standalone cluster on loopback, Sail. Needs Java 17 and the wheel; installs PySpark
# and Sail (1.5 GB) below target/.
#   scripts/cluster_tests.sh WHEEL [PYTEST ARGUMENTS…]
#   scripts/cluster_tests.sh    installs the engines alone
set -euo pipefail
cd "$(dirname "$0")/.."
wheel=${1:-}
[ $# = 0 ] || shift
target=${CARGO_TARGET_DIR:-target}
command -v java >/dev/null || { echo "no java: the tests on Spark need Java 17 or newer" >&2; exit 1; }
for engine in spark sail; do
    venv=$target/$engine-test
    [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "crates/python/cluster/requirements-$engine.txt"
    [ -n "$wheel" ] || continue
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$wheel" # And what it needs.
done
[ -n "$wheel" ] || exit 0
# Each of these virtual machines works for seconds: the second compiler and parallel collection cost more than they save.
export JAVA_TOOL_OPTIONS="-XX:TieredStopAtLevel=1 -XX:+UseSerialGC"
export RESIGHT_SAIL_PYTHON=$PWD/$target/sail-test/bin/python
case $target in /*) RESIGHT_SAIL_PYTHON=$target/sail-test/bin/python ;; esac
"$target/spark-test/bin/python" -m pytest -q --no-header crates/python/cluster "$@"
