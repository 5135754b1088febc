#!/usr/bin/env bash
# Installs each file of a release as its users do, in clean roots, and asks each for the first answer of README.md:
#   scripts/check_release.sh FOLDER
# Needs root, debootstrap and the files of scripts/release.sh. The work lies below target/clean-root.
set -euo pipefail
[ $# = 1 ] || { echo "usage: scripts/check_release.sh FOLDER" >&2; exit 2; }
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
mkdir -p "${CARGO_TARGET_DIR:-target}"
root=$(cd "${CARGO_TARGET_DIR:-target}" && pwd)/clean-root
command -v debootstrap >/dev/null || apt-get install -y -qq debootstrap >/dev/null
[ -f "$root/base/etc/os-release" ] || debootstrap --variant=minbase bookworm "$root/base" >/dev/null
(cd "$out" && sha256sum --quiet -c SHA256SUMS)

first=$(grep -m 1 '^  distance ' README.md) # The first answer that README.md shows.

answers() { # answers NAME ROOT COMMAND…: the first answer of README.md, as it stands there
    local name=$1 place=$2 started answer
    shift 2
    cp -r examples/photo "$place/photo"
    started=$(date +%s%N)
    answer=$(chroot "$place" "$@" locate /photo/left03.jpg --camera /photo/left.yml --target /photo/board.toml)
    grep -qF "$first" <<<"$answer" || { printf '%s: another answer:\n%s\n' "$name" "$answer" >&2; exit 1; }
    chroot "$place" "$@" --version
    echo "$name: the first answer after $(((($(date +%s%N) - started)) / 1000000)) ms"
}

fresh() { # fresh NAME: a root with nothing but Debian's base
    rm -rf "${root:?}/$1"
    cp -a "$root/base" "$root/$1"
    cp /etc/resolv.conf "$root/$1/etc/" 2>/dev/null || true
    echo "$root/$1"
}

place=$(fresh archive)
tar -xzf "$out"/resight-*-x86_64-unknown-linux-gnu.tar.gz -C "$place/usr/local" --strip-components=1
answers "archive" "$place" /usr/local/bin/resight

place=$(fresh deb)
cp "$out"/resight_*_amd64.deb "$place/"
chroot "$place" sh -c 'dpkg -i /resight_*_amd64.deb >/dev/null && test -s /usr/share/man/man1/resight-locate.1.gz'
answers "Debian package" "$place" resight
chroot "$place" sh -c 'dpkg -P resight >/dev/null && ! command -v resight >/dev/null'

# Python has its wheel in an environment with nothing else.
rm -rf "$root/venv"
python3 -m venv "$root/venv"
"$root/venv/bin/python" -m pip install --quiet --disable-pip-version-check "$out"/resight-*.whl
"$root/venv/bin/resight" locate examples/photo/left03.jpg --camera examples/photo/left.yml --target examples/photo/board.toml |
    grep -qF "$first"
"$root/venv/bin/python" -c 'import resight; print("wheel:", resight.__version__)'

# No symbol that an older glibc lacks, and no path of this machine.
for file in "$root/archive/usr/local/bin/resight" "$root"/archive/usr/local/lib/libresight_c.so.?.?.?; do
    newest=$(objdump -T "$file" | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1)
    echo "$(basename "$file"): $newest"
    [ "$(printf 'GLIBC_2.28\n%s\n' "$newest" | sort -V | tail -n 1)" = GLIBC_2.28 ]
    ! strings "$file" | grep -q -e "$HOME/.cargo" -e "$PWD/crates"
done
