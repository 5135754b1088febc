#!/bin/sh
# Resight against others, all in this run, on the same input; prints Markdown tables. Makes its own virtual environment
# under target/ and builds what it needs of Resight in release.
#   benches/peers/run.sh                tag image → pose, against OpenCV
#   benches/peers/run.sh four-points    four known points → pose, against OpenCV, PoseLib and COLMAP
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
venv=$target/peers-venv
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
pip() { "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$root/benches/peers/$1"; }
pip requirements.txt
profile=${PROFILE:-release}
case $profile in dev) folder=$target/debug ;; *) folder=$target/$profile ;; esac
build() { (cd "$root" && cargo build --quiet --profile "$profile" "$@"); }
mkdir -p "$target/peers"
case ${1:-} in
four-points)
    shift
    pip requirements-optional.txt || echo "no wheel of pycolmap for this machine: its row is left out" >&2
    build -p resight-cli
    build -p resight-core --example bench_four_points
    exec "$venv/bin/python" "$root/benches/peers/four_points.py" "$folder/resight" "$folder/examples/bench_four_points" \
        --folder "$target/peers" "$@"
    ;;
*)
    build -p resight --example bench_tag_pose
    exec "$venv/bin/python" "$root/benches/peers/tag_pose.py" "$folder/examples/bench_tag_pose" --folder "$target/peers" "$@"
    ;;
esac
