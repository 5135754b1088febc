#!/usr/bin/env bash
# Builds a release from the commit that is checked out, for Linux on x86_64 with glibc 2.28 or newer:
#   scripts/release.sh FOLDER
# FOLDER then has the program as an archive and as a Debian package, the wheel, the source, a Containerfile, the bill of materials, the licences
# of all crates, and checksums. The same commit gives the same bytes. scripts/check_release.sh installs each in a clean root.
set -euo pipefail
[ $# = 1 ] || { echo "usage: scripts/release.sh FOLDER" >&2; exit 2; }
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
[ -z "$(git status --porcelain)" ] || { echo "the work tree has changes that no commit has; commit or stash them" >&2; exit 1; }
mkdir -p "${CARGO_TARGET_DIR:-target}"
target=$(cd "${CARGO_TARGET_DIR:-target}" && pwd)
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
triple=x86_64-unknown-linux-gnu
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
RESIGHT_COMMIT=$(TZ=UTC git log -1 --format='%h, %cd' --date=format-local:%Y-%m-%d --abbrev=9)
cargo_home=${CARGO_HOME:-$HOME/.cargo}
# No path of this machine is in what is shipped.
RUSTFLAGS="--remap-path-prefix=$PWD=resight --remap-path-prefix=$cargo_home=cargo"
CFLAGS="-ffile-prefix-map=$PWD=resight -ffile-prefix-map=$cargo_home=cargo -ffile-prefix-map=$target=target"
export SOURCE_DATE_EPOCH RESIGHT_COMMIT RUSTFLAGS CFLAGS CARGO_TARGET_DIR=$target/released

venv=$target/wheel-build
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r crates/python/requirements-build.txt -r packaging/requirements.txt
export PATH=$venv/bin:$PATH
cargo zigbuild --release --locked --target "$triple.2.28" -p resight-cli -p resight-c
built=$CARGO_TARGET_DIR/$triple/release
rm -rf "$target/release-stage" "$target/released-wheels"
maturin build --release --locked --zig --compatibility manylinux_2_28 --target "$triple" --out "$target/released-wheels"
cp "$target"/released-wheels/resight-*.whl "$out/"

# The archive: a prefix as /usr/local is.
stage=$target/release-stage/resight-$version-$triple
mkdir -p "$stage"/{bin,share/man/man1,share/bash-completion/completions,share/zsh/site-functions,share/fish/vendor_completions.d,share/doc/resight,lib/systemd/system}
install -m 755 -s "$built/resight" "$stage/bin/"
"$stage/bin/resight" man -o "$stage/share/man/man1"
"$stage/bin/resight" completions bash >"$stage/share/bash-completion/completions/resight"
"$stage/bin/resight" completions zsh >"$stage/share/zsh/site-functions/_resight"
"$stage/bin/resight" completions fish >"$stage/share/fish/vendor_completions.d/resight.fish"
cp packaging/systemd/*.service "$stage/lib/systemd/system/"
cp LICENSE-MIT LICENSE-APACHE README.md CHANGELOG.md "$stage/share/doc/resight/"
cargo metadata --locked --format-version 1 --filter-platform "$triple" |
    python3 packaging/bill_of_materials.py "$out/resight-$version.cdx.json" "$stage/share/doc/resight/LICENSES-OF-CRATES"
cp "$stage/share/doc/resight/LICENSES-OF-CRATES" "$out/"

archive() { # archive FOLDER FILE: the same bytes from the same files
    tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$SOURCE_DATE_EPOCH" --mode=u+w,go+r-w,a+X -C "$(dirname "$1")" -cf - "$(basename "$1")" | gzip -n -9 >"$2"
}

# The Debian package: the same below /usr.
package=$target/release-stage/deb
mkdir -p "$package/DEBIAN" "$package/usr"
cp -r "$stage"/{bin,share,lib} "$package/usr/"
mv "$package/usr/share/zsh/site-functions" "$package/usr/share/zsh/vendor-completions"
gzip -n -9 "$package"/usr/share/man/man1/*.1
cat LICENSE-MIT >"$package/usr/share/doc/resight/copyright"
cat >"$package/DEBIAN/control" <<CONTROL
Package: resight
Version: $version
Architecture: amd64
Maintainer: The Resight authors <resight@users.noreply.github.com>
Installed-Size: $(du -sk "$package/usr" | cut -f1)
Depends: libc6 (>= 2.28), libgcc-s1
Recommends: ffmpeg, ca-certificates
Section: science
Priority: optional
Homepage: https://github.com/resight/resight
Description: Where cameras are, from a few known points
 Resight computes the pose of a camera from known points in an image, with its
 covariance and a verdict on whether to trust it; calibrates rigs and robots'
 cameras; and reports when a mounted camera has moved.
CONTROL
find "$package" -newermt "@$SOURCE_DATE_EPOCH" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
dpkg-deb --root-owner-group -Zxz --build "$package" "$out/resight_${version}_amd64.deb" >/dev/null

# The library for C goes into the archive alone: a package of Debian would be two more.
scripts/install_c.sh "$stage" "$built" >/dev/null
sed -i "s|^prefix=.*|prefix=\${pcfiledir}/../..|" "$stage/lib/pkgconfig/resight.pc"
archive "$stage" "$out/resight-$version-$triple.tar.gz"
git archive --format=tar --prefix="resight-$version/" HEAD | gzip -n -9 >"$out/resight-$version.tar.gz"
cp packaging/Containerfile "$out/"
(cd "$out" && sha256sum resight[-_]* Containerfile LICENSES-OF-CRATES >SHA256SUMS)
cat "$out/SHA256SUMS"
