#!/bin/sh
# Resight against OpenCV, both in this run, on the same pictures; prints Markdown tables. Makes its own virtual
# environment under target/ and builds the release example.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
venv=$target/peers-venv
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet -r "$root/benches/peers/requirements.txt"
profile=${PROFILE:-release}
(cd "$root" && cargo build --quiet --profile "$profile" -p resight --example bench_tag_pose)
case $profile in dev) folder=debug ;; *) folder=$profile ;; esac
mkdir -p "$target/peers"
"$venv/bin/python" "$root/benches/peers/tag_pose.py" "$target/$folder/examples/bench_tag_pose" --folder "$target/peers" "$@"
