#!/usr/bin/env bash
# rustc with Clippy's lints, warnings denied, for `RUSTC_WRAPPER=scripts/rustc_checked.sh cargo test`. Unit tests of a library run for less time than
# its optimisation takes: they are optimised little, and benches, which are only built here, not at all.
set -euo pipefail
is_test=
is_library=
level=()
for word in "$@"; do
    case $word in
    --test) is_test=yes ;;
    */src/lib.rs) is_library=yes ;;
    */benches/*.rs) level=(-C opt-level=0) ;;
    esac
done
[ "$is_test$is_library" != yesyes ] || level=(-C opt-level=1)
exec clippy-driver "$@" -D warnings "${level[@]}"
