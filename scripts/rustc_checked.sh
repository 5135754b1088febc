#!/usr/bin/env bash
# rustc with Clippy's lints, for `RUSTC_WRAPPER=scripts/rustc_checked.sh cargo test`. A test spends its time in the library that it calls: test programs
# are optimised little, and benches, which are only built here, not at all.
set -euo pipefail
level=()
for word in "$@"; do
    case $word in
    --test) level=(-C opt-level=1) ;;
    */benches/*.rs) level=(-C opt-level=0) ;;
    esac
done
exec clippy-driver "$@" "${level[@]}"
