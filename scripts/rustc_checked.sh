#!/usr/bin/env bash
# rustc with warnings denied and Clippy's lints, for `RUSTC_WRAPPER=scripts/rustc_checked.sh cargo test`. Clippy reads a library when its unit tests
# are built, which are made of the same files. These run for less time than their optimisation takes: they are optimised a level less than the
# library, and benches, which are only built here, not at all.
set -euo pipefail
driver=(clippy-driver "$1")
is_library=
is_test=
unit_test_level=0
level=()
for word in "$@"; do
    case $word in
    --test) is_test=yes ;;
    */src/lib.rs) is_library=yes ;;
    opt-level=2) unit_test_level=1 ;;
    */benches/*.rs) level=(-C opt-level=0) ;;
    esac
done
case $is_library$is_test in
yes) [[ " $* " != *" --crate-type lib "* ]] || driver=("$1") ;;
yesyes) level=(-C "opt-level=$unit_test_level") ;;
esac
exec "${driver[@]}" "${@:2}" -D warnings "${level[@]}"
