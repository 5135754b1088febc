#!/bin/sh
# Unpacks every video of a folder into grey PNG frames, for tests on recorded sets:
#   scripts/unpack_videos.sh VIDEO_DIR FRAMES_DIR
# writes FRAMES_DIR/<video name>/000001.png … in recording order. Needs `ffmpeg`, or python3 with the package index
# within reach (the imageio-ffmpeg wheel carries an ffmpeg; it goes into FRAMES_DIR/.venv).
set -eu
videos=${1:?usage: unpack_videos.sh VIDEO_DIR FRAMES_DIR}
frames=${2:?usage: unpack_videos.sh VIDEO_DIR FRAMES_DIR}
mkdir -p "$frames"

if command -v ffmpeg >/dev/null 2>&1; then
    ffmpeg=ffmpeg
else
    [ -x "$frames/.venv/bin/python" ] || python3 -m venv "$frames/.venv"
    "$frames/.venv/bin/python" -c 'import imageio_ffmpeg' 2>/dev/null ||
        "$frames/.venv/bin/pip" install --quiet imageio-ffmpeg
    ffmpeg=$("$frames/.venv/bin/python" -c 'import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())')
fi

for video in "$videos"/*.mp4; do
    [ -e "$video" ] || { echo "no .mp4 in $videos" >&2; exit 1; }
    name=$(basename "$video" .mp4)
    [ -e "$frames/$name/.done" ] && continue
    rm -rf "$frames/$name"
    mkdir -p "$frames/$name"
    # An index per decoded frame: none dropped, none doubled.
    "$ffmpeg" -nostdin -loglevel error -i "$video" -fps_mode passthrough -pix_fmt gray "$frames/$name/%06d.png"
    touch "$frames/$name/.done"
    echo "$name: $(ls "$frames/$name" | wc -l) frames"
done
