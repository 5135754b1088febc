#!/bin/sh
# Resight against others, all in this run, on the same input; prints Markdown tables. Makes its own virtual environment
# under target/ and builds what it needs of Resight in release.
#   benches/peers/run.sh                every table below
#   benches/peers/run.sh tag            tag image → pose, against OpenCV
#   benches/peers/run.sh detect         five targets over a sweep of conditions, against OpenCV, dt-apriltags and aprilgrid
#   benches/peers/run.sh four-points    four known points → pose, against OpenCV, PoseLib and COLMAP
#   benches/peers/run.sh family         minimal solvers, refinement, n points, wrong correspondences, against the same
#   benches/peers/run.sh rig            relative extrinsics of several cameras, against mrcal (Debian's python3-mrcal) and OpenCV
#   benches/peers/run.sh hand-eye       where a camera sits on a robot, against the seven methods of OpenCV, on held-out views
#   benches/peers/run.sh whisker        a whisker's hub signals → contacts, against SciPy and the torque-only estimator
#   benches/peers/run.sh python         all called from Python, what a call costs included: the README's table, single calls, rigs
#   benches/peers/run.sh bad-inputs     what each makes of 23 bad inputs
#   benches/peers/run.sh faults         wrong files for recorded pairs of cameras, beside OpenCV; needs RESIGHT_DATA
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
venv=$target/peers-venv
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
pip() { "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$root/benches/peers/$1"; }
pip requirements.txt
pip requirements-optional.txt || echo "no wheel of pycolmap for this machine: its rows are left out" >&2
profile=${PROFILE:-release}
case $profile in dev) folder=$target/debug ;; *) folder=$target/$profile ;; esac
build() { (cd "$root" && cargo build --quiet --profile "$profile" "$@"); }
compare() { # compare SCRIPT ARGUMENT…
    script=$1
    shift
    "$venv/bin/python" "$root/benches/peers/$script" "$@" --folder "$target/peers"
}
wheel() { # the package; RESIGHT_WHEEL is one that is built already
    if [ -z "${RESIGHT_WHEEL:-}" ]; then
        pip ../../crates/python/requirements-build.txt
        (cd "$root" && PATH=$venv/bin:$PATH CARGO_TARGET_DIR=$target maturin build --quiet --release --out "$target/peers")
    fi
    "$venv/bin/python" -m pip install --quiet --force-reinstall --no-deps "${RESIGHT_WHEEL:-$(ls -t "$target"/peers/resight-*.whl | head -n 1)}"
}
mkdir -p "$target/peers"
table=${1:-all}
[ $# = 0 ] || shift
case $table in
tag)
    build -p resight --example bench_tag_pose
    compare tag_pose.py "$folder/examples/bench_tag_pose" "$@"
    ;;
detect)
    # The library aprilgrid asks for OpenCV with windows, which is not needed here and would replace the one without.
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps aprilgrid==0.5.0 dt-apriltags==3.1.7 ||
        echo "no wheel of aprilgrid or dt-apriltags for this machine: their rows are left out" >&2
    build -p resight --example bench_detect
    compare detect.py "$folder/examples/bench_detect" "$@"
    ;;
four-points)
    wheel
    compare four_points.py "$@"
    ;;
python)
    wheel
    build -p resight --example bench_points
    compare python.py --rust "$folder/examples/bench_points" "$@"
    ;;
family)
    build -p resight-core --example bench_family
    compare solvers.py "$folder/examples/bench_family" "$@"
    ;;
rig)
    build -p resight-core --example bench_rig
    compare rig.py "$folder/examples/bench_rig" "$@"
    ;;
hand-eye)
    # OpenCV 5 has no Python binding of its hand–eye methods.
    venv=$target/peers-venv-opencv4
    [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
    pip requirements-hand-eye.txt
    build -p resight-core --example bench_hand_eye
    compare hand_eye.py "$folder/examples/bench_hand_eye" "$@"
    ;;
whisker)
    build -p resight-cli
    build -p resight-whisker --example bench_contact
    compare whisker.py "$folder/resight" "$folder/examples/bench_contact" "$@"
    ;;
bad-inputs)
    build -p resight-cli
    compare bad_inputs.py "$folder/resight" "$@"
    ;;
faults)
    if [ -z "${RESIGHT_DATA:-}" ]; then
        echo "left out: RESIGHT_DATA, the folder of the recordings, is not set"
        exit 0
    fi
    build -p resight-cli
    compare faults.py "$folder/resight" --data "$RESIGHT_DATA" "$@"
    ;;
all)
    for table in tag detect four-points python family rig hand-eye whisker bad-inputs faults; do
        printf '\n## %s\n\n' "$table"
        "$0" "$table"
    done
    ;;
*)
    echo "no such table: $table; there are tag, detect, four-points, python, family, rig, hand-eye, whisker, bad-inputs, faults and, without a name, all of them" >&2
    exit 2
    ;;
esac
