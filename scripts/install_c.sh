#!/usr/bin/env bash
# Installs the library for C below a prefix: lib/libresight_c.*, include/resight.h and lib/pkgconfig/resight.pc.
#   scripts/install_c.sh PREFIX          builds it first: cargo build --release -p resight-c
#   scripts/install_c.sh PREFIX FOLDER   takes the libraries that lie in this folder
set -euo pipefail
[ $# = 1 ] || [ $# = 2 ] || { echo "usage: scripts/install_c.sh PREFIX [FOLDER]" >&2; exit 2; }
mkdir -p "$1/lib/pkgconfig" "$1/include"
prefix=$(cd "$1" && pwd)
folder=${2:+$(cd "$2" && pwd)}
cd "$(dirname "$0")/.."
if [ -z "$folder" ]; then
    cargo build --release -p resight-c
    folder=${CARGO_TARGET_DIR:-target}/release
fi
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
interface=${version%.*} # As crates/c/build.rs names it.

install -m 644 crates/c/include/resight.h "$prefix/include/"
install -m 644 "$folder/libresight_c.a" "$prefix/lib/"
case "$(uname -s)" in
Darwin)
    install -m 755 "$folder/libresight_c.dylib" "$prefix/lib/libresight_c.$interface.dylib"
    ln -sf "libresight_c.$interface.dylib" "$prefix/lib/libresight_c.dylib"
    ;;
*)
    install -m 755 "$folder/libresight_c.so" "$prefix/lib/libresight_c.so.$version"
    ln -sf "libresight_c.so.$version" "$prefix/lib/libresight_c.so.$interface"
    ln -sf "libresight_c.so.$interface" "$prefix/lib/libresight_c.so"
    ;;
esac
sed -e "s|@PREFIX@|$prefix|" -e "s|@VERSION@|$version|" crates/c/resight.pc.in >"$prefix/lib/pkgconfig/resight.pc"
