#!/usr/bin/env bash
# rustdoc for `RUSTDOC=scripts/rustdoc_checked.sh cargo test`: writes the documentation of a crate, with warnings denied, before its examples run.
# `cargo doc` compiles every dependency once more for that.
set -euo pipefail
pages=()
is_test=
skipped=0
for word in "$@"; do
    case $word in
    --test) is_test=yes ;;
    --test-*) skipped=1 ;; # Its value follows.
    *) ((skipped == 0)) && pages+=("$word") || skipped=0 ;;
    esac
done
[ -z "$is_test" ] || rustdoc "${pages[@]}" -D warnings --out-dir "${CARGO_TARGET_DIR:-target}/doc"
exec rustdoc "$@"
