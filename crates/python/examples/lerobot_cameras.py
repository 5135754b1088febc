"""Checks the cameras of a LeRobot dataset against pinned mount poses, episode by episode (docs/lerobot.md).

lerobot_cameras.py DATASET --pin DIR --camera front=front.yml --target tag.toml    writes the references
lerobot_cameras.py DATASET --reference DIR                                         compares every episode with them

Every comparison, verdict and sentence is that of `resight watch`; this file only takes frames out of datasets (v2.x and v3.0).
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import resight

SESSION = "cameras.session.toml"
VERDICTS = {"steady": "ok", "tracking": "ok", "drifted": "moved", "stale": "not seen"}  # Other states are undecided.
# `resight watch` learns a reference from twenty readings or more; as many again must agree with it.
LEARN = 20


@dataclass(frozen=True)
class Finding:
    """What became of a camera, or of a target that several cameras see, in an episode: `ok`, `moved`, `not seen` or `undecided`."""

    episode: int
    camera: str | None
    target: str | None
    verdict: str
    message: str
    event: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """The object of `--json`; `event` is that of `resight watch --json`."""
        return {key: value for key, value in vars(self).items() if value is not None}

    def __str__(self) -> str:
        name = short(self.camera) if self.camera is not None else f"target {self.target}"
        return f"episode {self.episode:<4} {name:<12} {self.verdict:<9}  {self.message}"


@dataclass(frozen=True)
class Episode:
    """An episode with its row of the metadata."""

    index: int
    length: int
    row: Mapping[str, Any]


@dataclass(frozen=True)
class Dataset:
    """A local dataset: its folder, meta/info.json, and the episodes."""

    root: Path
    info: Mapping[str, Any]
    episodes: list[Episode]

    @property
    def keys(self) -> list[str]:
        """The features that are images of a camera; depth images are none."""
        return [key for key, feature in self.info["features"].items() if feature["dtype"] in ("video", "image") and not _is_depth(feature)]

    def key(self, name: str) -> str:
        """The key of a camera that is named in full or by its last part. Raises `resight.Error` for any other name."""
        found = [key for key in self.keys if name in (key, short(key))]
        if len(found) != 1:
            known = ", ".join(short(key) for key in self.keys) or "none, its features are no images or videos"
            raise resight.Error(f"{self.root}: no camera is called {name}; its cameras: {known}", "request")
        return found[0]

    def size_px(self, key: str) -> tuple[int, int] | None:
        """Width and height of the images of a camera, where the metadata name them."""
        feature = self.info["features"][key]
        sides: dict[str, int] = dict(zip(feature.get("names") or (), feature["shape"]))
        return (sides["width"], sides["height"]) if {"width", "height"} <= sides.keys() else None

    def chosen(self, indices: Iterable[int]) -> list[Episode]:
        """Episodes by number."""
        known = {episode.index: episode for episode in self.episodes}
        missing = [str(i) for i in indices if i not in known]
        if missing:
            raise resight.Error(f"{self.root}: no episode {', '.join(missing)}; it has {len(known)}", "request")
        return [known[i] for i in indices]

    def period_s(self, episode: Episode, n_frames: int) -> float:
        """The time between the frames that `write_frames` takes, seconds."""
        return _step(episode, n_frames) / float(self.info["fps"])

    def write_frames(self, episode: Episode, key: str, n_frames: int, folder: Path) -> None:
        """Writes about so many frames of an episode, evenly spaced, as images in the order of time."""
        folder.mkdir(parents=True, exist_ok=True)
        if self.info["features"][key]["dtype"] == "video":
            self._write_video_frames(episode, key, n_frames, folder)
        else:
            self._write_stored_images(episode, key, n_frames, folder)

    def _path(self, episode: Episode, template: str, key: str) -> Path:
        """Returns the file of an episode by a template of meta/info.json: one file an episode (v2), or the one that the metadata name (v3)."""
        part = f"videos/{key}" if template == "video_path" else "data"
        index = episode.index
        names = {"video_key": key, "episode_index": index, "episode_chunk": index // self.info.get("chunks_size", 1000)}
        names |= {name: episode.row[f"{part}/{name}"] for name in ("chunk_index", "file_index") if f"{part}/{name}" in episode.row}
        try:
            return _file(self.root / self.info[template].format(**names))
        except (KeyError, AttributeError):
            raise resight.Error(f"{self.root}: meta/ does not state in which file episode {index} of {key} is", "file") from None

    def _write_video_frames(self, episode: Episode, key: str, n_frames: int, folder: Path) -> None:
        """Takes frames out of a video, which holds several episodes in v3."""
        path, fps, step = self._path(episode, "video_path", key), float(self.info["fps"]), _step(episode, n_frames)
        begin_s = max(0.0, episode.row.get(f"videos/{key}/from_timestamp", 0.0) - 0.5 / fps)  # Half a frame early: no rounding loses the first one.
        span = ["-ss", f"{begin_s:.6f}", "-t", f"{episode.length / fps:.6f}"]
        chosen = ["-vf", rf"select=not(mod(n\,{step}))", "-fps_mode", "passthrough", "-pix_fmt", "gray", "-compression_level", "1"]
        command = [_ffmpeg(), "-nostdin", "-loglevel", "error", *span, "-i", str(path), *chosen, str(folder / f"{episode.index:06}-%06d.png")]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode != 0 or not any(folder.glob(f"{episode.index:06}-*.png")):
            reason = (ended.stderr.strip() or "no frame at the time of this episode").splitlines()[-1]
            raise resight.Error(f"{path}: episode {episode.index} cannot be decoded: {reason}", "file")

    def _write_stored_images(self, episode: Episode, key: str, n_frames: int, folder: Path) -> None:
        """Copies images that are stored in the table, or beside it."""
        path = self._path(episode, "data_path", key)
        picked = list(range(0, episode.length, _step(episode, n_frames)))
        images = _parquet(path, [key], [("episode_index", "=", episode.index), ("frame_index", "in", picked)])
        if not images:
            raise resight.Error(f"{path}: no rows of episode {episode.index}", "file")
        for i, image in enumerate(row[key] for row in images):
            content = image["bytes"] if image["bytes"] is not None else _file(self.root / image["path"]).read_bytes()
            ending = "png" if content.startswith(b"\x89PNG") else "jpg" if content.startswith(b"\xff\xd8") else None
            if ending is None:
                raise resight.Error(f"{path}: image {i} of episode {episode.index} is neither PNG nor JPEG", "file")
            (folder / f"{episode.index:06}-{i:06}.{ending}").write_bytes(content)


def open_dataset(root: str | Path) -> Dataset:
    """A dataset of LeRobot in a local folder, of format v2.x or v3.0. Raises `resight.Error` for any other folder."""
    root = Path(root)
    info = _json(_file(root / "meta/info.json").read_text(), root / "meta/info.json")
    version = str(info.get("codebase_version", "of no version"))
    if version.startswith("v2."):
        path = _file(root / "meta/episodes.jsonl")
        rows = [_json(line, path) for line in path.read_text().splitlines() if line.strip()]
    elif version.startswith("v3."):
        paths = sorted((root / "meta/episodes").glob("*/*.parquet"))
        rows = [row for path in paths or [root / "meta/episodes/chunk-000/file-000.parquet"] for row in _episode_rows(path)]
    else:
        raise resight.Error(f"{root}: a dataset {version}; v2.x and v3.0 are read. LeRobot converts older ones", "file")
    missing = [key for key in ("features", "fps") if key not in info] + [key for key in ("episode_index", "length") if any(key not in row for row in rows)]
    if missing or not rows:
        raise resight.Error(f"{root}: meta/ states no {', '.join(missing) or 'episodes'}", "file")
    return Dataset(root, info, [Episode(int(row["episode_index"]), int(row["length"]), row) for row in rows])


def pin(dataset: Dataset, cameras: Mapping[str, resight.Camera], folder: str | Path, *, target: tuple[str, resight.Target] | None = None,
        episodes: Sequence[int] = (0, 1, 2), n_frames: int = 30) -> list[str]:
    """Writes what later episodes are compared with: the pose beside a target for each camera, or without one a reference image of the scene.

    `cameras`: names to intrinsics; `target`: its name and itself; `episodes`: those during which nothing moved. The folder is a session of
    `resight watch`. Raises `resight.Error` where a camera moved or saw too little.
    """
    folder = Path(folder)
    if (folder / SESSION).exists():
        raise resight.Error(f"{folder / SESSION} exists; remove the folder to pin the cameras anew", "write")
    chosen = dataset.chosen(episodes)
    total = sum(min(n_frames, episode.length) for episode in chosen)
    if target is not None and total < 2 * LEARN:
        raise resight.Error(f"{total} frames are given, {2 * LEARN} are needed: more --episodes or more --frames", "request")
    with tempfile.TemporaryDirectory() as temporary:
        new = Path(temporary)
        tables: dict[str, dict[str, str]] = {}
        for name, camera in cameras.items():
            key = dataset.key(name)
            _fits(dataset, key, camera)
            name = short(key)
            (new / f"{name}.camera.toml").write_text(camera.to_toml())
            tables[f"camera.{name}"] = {"file": f"{name}.camera.toml"} | (
                {"landmarks": f"{name}.png"} if target is None else {"reference": f"{name}.ref.toml"})
        if target is not None:
            (new / f"{target[0]}.target.toml").write_text(target[1].to_toml())
            tables[f"target.{target[0]}"] = {"file": f"{target[0]}.target.toml"}
        learning = {table: {f"save_{key}" if key in ("reference", "landmarks") else key: value for key, value in keys.items()}
                    for table, keys in tables.items()}
        for finding in _watched(dataset, chosen, n_frames, new, learning, learn=max(LEARN, total // 2)):
            if finding.verdict != "ok":
                who = finding.target if finding.camera is None else short(finding.camera)
                raise resight.Error(f"nothing is pinned; in these episodes {who}: {finding.verdict}, {finding.message}", "request")
        shutil.copytree(new, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("frames", "watched.toml"))
        (folder / SESSION).write_text(_toml({}, tables))
    return [table.removeprefix("camera.") for table in tables if table.startswith("camera.")]


def check(dataset: Dataset, folder: str | Path, *, episodes: Sequence[int] | None = None, n_frames: int = 30) -> Iterator[Finding]:
    """Compares each episode with the references that `pin` wrote: one finding a camera, and one for a target that moved."""
    folder = Path(folder)
    path = folder / SESSION
    if not path.exists():
        raise resight.Error(f"{path} is missing: --pin writes it", "file")
    tables = {f"{kind}.{name}": keys for kind, named in tomllib.loads(path.read_text()).items() for name, keys in named.items()}
    for table in tables:
        if table.startswith("camera."):
            dataset.key(table.removeprefix("camera."))
    for episode in dataset.episodes if episodes is None else dataset.chosen(episodes):
        yield from _watched(dataset, [episode], n_frames, folder, tables)


def short(key: str) -> str:
    """The name of a camera in sessions and messages."""
    return re.sub(r"[^\w-]", "_", key.removeprefix("observation.images.").removeprefix("observation."))


def _watched(dataset: Dataset, episodes: Sequence[Episode], n_frames: int, folder: Path, tables: Mapping[str, Mapping[str, str]], *,
             learn: int | None = None) -> list[Finding]:
    """Runs `resight watch` over frames of these episodes, and collects what it says of each camera."""
    keys = {table.removeprefix("camera."): dataset.key(table.removeprefix("camera.")) for table in tables if table.startswith("camera.")}
    with tempfile.TemporaryDirectory() as temporary:
        given = {table: {key: str((folder / value).absolute()) for key, value in of.items()} for table, of in tables.items()}
        n_taken = 0
        for name, key in keys.items():
            frames = Path(temporary) / name
            for episode in episodes:
                dataset.write_frames(episode, key, n_frames, frames)
            given[f"camera.{name}"]["source"] = f"{frames}/*"
            n_taken = max(n_taken, len(list(frames.iterdir())))
        period_s = dataset.period_s(episodes[0], n_frames)
        # Stale is what saw nothing from the first frame to the last but one.
        head: dict[str, Any] = {"once": True, "period_s": period_s, "stale_after_s": max(1.0, n_taken - 1.5) * period_s}
        session = Path(temporary) / "watched.toml"
        session.write_text(_toml(head if learn is None else head | {"learn": learn}, given))
        with resight.watch(session, once=True) as events:
            heard = [event.to_dict() for event in events]
    return _findings(episodes[0].index, keys, heard)


def _findings(episode: int, keys: Mapping[str, str], heard: Sequence[dict[str, Any]]) -> list[Finding]:
    """Returns a finding for each camera, and for each target that moved."""
    named = next((event for event in heard if event["event"] == "verdict" and "camera" not in event), {})
    is_open = bool(named.get("alternatives"))
    targets = [] if is_open else [name for name in named.get("moved", []) if name not in keys]
    findings = [Finding(episode, None, name, "moved", named["message"], named) for name in targets]
    for name, key in keys.items():
        own = [event for event in heard if event.get("camera") == name]
        states = [event for event in own if event["event"] == "state"]
        learning = [event for event in own if event["event"] == "moved_while_learning"]
        # A camera that moved and came back within an episode has moved; where something else moved, or may have, its last state counts.
        alarms = [] if targets or is_open else [event for event in states if event["state"] == "drifted"]
        event = (learning or alarms or states)[-1]
        verdict = "moved" if learning else VERDICTS.get(event["state"], "undecided")
        compared = [] if targets else [other for other in own if other["event"] == "compared"]
        event = compared[-1] if verdict == "ok" and compared else event
        reason = {"not seen": event.get("reason"), "undecided": named.get("message")}.get(verdict)
        findings.append(Finding(episode, key, None, verdict, reason or re.sub(r"^(moved|checking:) ", "", event["message"]), event))
    return findings


def _fits(dataset: Dataset, key: str, camera: resight.Camera) -> None:
    """Tests whether intrinsics are of images of this size."""
    size_px = dataset.size_px(key)
    if None not in (size_px, camera.image_size_px) and size_px != camera.image_size_px:
        raise resight.Error(f"{key}: its images have {size_px} px, its intrinsics are of images of {camera.image_size_px} px; calibrate it at the size that is recorded",
                            "intrinsics")


def _is_depth(feature: Mapping[str, Any]) -> bool:
    """Tests whether the images of a feature are depths."""
    about = (feature.get("info") or {}) | (feature.get("video_info") or {})
    return bool(about.get("is_depth_map") or about.get("video.is_depth_map"))


def _step(episode: Episode, n_frames: int) -> int:
    """Returns which frames are taken: each n-th."""
    return max(1, episode.length // n_frames)


def _file(path: Path) -> Path:
    """Returns a path where there is a file with content."""
    if not path.is_file():
        raise resight.Error(f"{path} is missing; is this the folder of a dataset (with meta/info.json), and is all of it downloaded?", "file")
    with path.open("rb") as file:
        if file.read(23) == b"version https://git-lfs":
            raise resight.Error(f"{path} is a pointer of Git LFS: `git lfs pull` in the dataset fetches the file", "file")
    return path


def _json(text: str, path: Path) -> dict[str, Any]:
    """Reads a JSON object."""
    try:
        value: dict[str, Any] = json.loads(text)
    except ValueError as reason:
        raise resight.Error(f"{path}: no JSON: {reason}", "file") from None
    return value


def _episode_rows(path: Path) -> list[dict[str, Any]]:
    """Reads the metadata of episodes, without their statistics."""
    try:
        names = import_module("pyarrow.parquet").read_schema(_file(path)).names
    except (OSError, ValueError) as reason:
        raise resight.Error(f"{path}: no Parquet file: {reason}", "file") from None
    return _parquet(path, [name for name in names if not name.startswith("stats/")])


def _parquet(path: Path, columns: list[str], filters: list[tuple[str, str, Any]] | None = None) -> list[dict[str, Any]]:
    """Reads rows of a table."""
    try:
        rows: list[dict[str, Any]] = import_module("pyarrow.parquet").read_table(path, columns=columns, filters=filters).to_pylist()
    except (OSError, ValueError) as reason:
        raise resight.Error(f"{path}: no Parquet file with {', '.join(columns)}: {reason}", "file") from None
    return rows


def _ffmpeg() -> str:
    """Returns the ffmpeg of the system, or that of the package imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except ImportError:
        raise resight.Error("videos need ffmpeg: install it, or `pip install imageio-ffmpeg`", "request") from None


def _toml(head: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]]) -> str:
    """Writes a session; JSON writes booleans, numbers and strings as TOML does."""
    def lines(keys: Mapping[str, Any]) -> str:
        return "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in keys.items())

    return lines(head) + "".join(f"\n[{table}]\n{lines(keys)}" for table, keys in tables.items())


def _named(given: Sequence[str], flag: str) -> dict[str, str]:
    """Reads NAME=VALUE."""
    pairs = [pair.partition("=") for pair in given]
    wrong = [name for name, separator, value in pairs if not (name and separator and value)]
    if wrong:
        raise resight.Error(f"{flag} {wrong[0]}: NAME=VALUE is needed, such as front=front.yml", "request")
    return {name: value for name, _, value in pairs}


def _indices(text: str) -> list[int]:
    """Reads episodes such as 0-4,7."""
    if not re.fullmatch(r"\d+(-\d+)?(,\d+(-\d+)?)*", text):
        raise resight.Error(f"--episodes {text}: numbers and ranges are needed, such as 0-4,7", "request")
    parts = [part.split("-") for part in text.split(",")]
    return [i for ends in parts for i in range(int(ends[0]), int(ends[-1]) + 1)]


def _cameras(dataset: Dataset, files: Mapping[str, str], fields: Mapping[str, str]) -> dict[str, resight.Camera]:
    """Reads intrinsics, or takes nominal ones from fields of view."""
    cameras = {name: resight.read_camera(file) for name, file in files.items()}
    for name, degrees in fields.items():
        size_px = dataset.size_px(dataset.key(name))
        if size_px is None:
            raise resight.Error(f"{name}: the metadata do not state the size of its images; give --camera {name}=FILE", "request")
        cameras[name] = resight.Camera.nominal(image_size_px=size_px, hfov_deg=float(degrees))
    if not cameras:
        names = ", ".join(short(key) for key in dataset.keys)
        raise resight.Error(f"--camera NAME=FILE or --hfov-deg NAME=DEGREES is needed for each camera to pin, of: {names}", "request")
    return cameras


def _report(dataset: Dataset, findings: Iterable[Finding], is_json: bool) -> int:
    """Prints each finding, then for each camera how many episodes are ok; the exit status."""
    counted: dict[str, list[Finding]] = {}
    for finding in findings:
        print(json.dumps(finding.to_dict()) if is_json else finding, flush=True)
        counted.setdefault(finding.camera or f"target {finding.target}", []).append(finding)
    for key, of in counted.items():
        moved = [finding.episode for finding in of if finding.verdict == "moved"]
        n_ok = sum(finding.verdict == "ok" for finding in of)
        if not is_json:
            print(f"{short(key)}: ok in {n_ok} of {len(of)} episodes" + (f", moved in {len(moved)}, first in episode {moved[0]}" if moved else ""))
    for key in dataset.keys:
        if key not in counted:
            print(f"{short(key)}: not checked, it has no reference", file=sys.stderr)
    return int(any(finding.verdict != "ok" for of in counted.values() for finding in of))


def main(arguments: Sequence[str] | None = None) -> int:
    """0: every camera is ok in every episode; 1: one moved, was not seen or is undecided; 2: an error."""
    parser = argparse.ArgumentParser(description="Checks the cameras of a LeRobot dataset against pinned mount poses.")
    parser.add_argument("dataset", help="local folder, with meta/info.json")
    parser.add_argument("--pin", metavar="DIR", help="write the references of the cameras into this new folder")
    parser.add_argument("--reference", metavar="DIR", help="compare every episode with the references in this folder")
    parser.add_argument("--camera", metavar="NAME=FILE", action="append", default=[], help="with --pin: intrinsics of a camera, in any format that resight reads")
    parser.add_argument("--hfov-deg", metavar="NAME=DEGREES", action="append", default=[], help="with --pin: without intrinsics, the horizontal field of view")
    parser.add_argument("--target", metavar="FILE", help="with --pin: the tag or board that stays in view; without one the scene itself is compared")
    parser.add_argument("--episodes", metavar="0-4,7", help="which episodes; by default the first three with --pin, else all")
    parser.add_argument("--frames", type=int, default=30, help="frames of each episode, 30 by default")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")
    given = parser.parse_args(arguments)
    try:
        if (given.pin is None) == (given.reference is None):
            raise resight.Error("one of --pin DIR and --reference DIR is needed", "request")
        if given.frames < 5:
            raise resight.Error(f"--frames {given.frames}: 5 or more are needed", "request")
        dataset = open_dataset(given.dataset)
        episodes = None if given.episodes is None else _indices(given.episodes)
        if given.reference is not None:
            return _report(dataset, check(dataset, given.reference, episodes=episodes, n_frames=given.frames), given.json)
        cameras = _cameras(dataset, _named(given.camera, "--camera"), _named(given.hfov_deg, "--hfov-deg"))
        target = None if given.target is None else (re.sub(r"[^\w-]", "_", Path(given.target).stem), resight.read_target(given.target))
        first = [episode.index for episode in dataset.episodes[:3]]
        pinned = pin(dataset, cameras, given.pin, target=target, episodes=first if episodes is None else episodes, n_frames=given.frames)
        print(f"pinned {', '.join(pinned)} in {given.pin}")
        return 0
    except resight.Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
