"""Recordings of other people's libraries, watched end to end, and the recording that `watch --tf` writes, read by their readers.

    python scripts/judges/ros_recordings.py

Writes the samples of `_recordings.py` anew, runs `resight watch` on them, and compares its JSON with the poses the tags were drawn from.
Then `mcap-ros2-support` and `rosbags` read the transforms, poses with covariance and diagnostics back and compare them with the JSON; the
definitions in the file must be those that rosbags knows for these types. A run that is killed must leave whole chunks.
The program is the one named by RESIGHT_PROGRAM, otherwise it is built here.
"""

import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import _recordings as samples
from mcap.reader import NonSeekingReader, SeekingReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Corners come from rendered pictures of 320 × 240; a tag of 0.16 m at 0.4 m.
PLACE_M, TURN_RAD = 0.004, 0.012


def program():
    if "RESIGHT_PROGRAM" in os.environ:
        return os.environ["RESIGHT_PROGRAM"]
    build = ["cargo", "build", "--quiet", "-p", "resight-cli", "--message-format=json"]
    made = subprocess.run(build, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [json.loads(line).get("executable") for line in made.splitlines() if line.startswith("{")]
    return next(path for path in paths if path and pathlib.Path(path).stem == "resight")


def watch(resight, folder, cameras, sources, *more):
    command = [resight, "watch", "--target", f"tag={folder / 'tag.toml'}", "--once", "--json", "--frames", "--learn", "20"]
    for name, camera in cameras.items():
        command += ["--camera", f"{name}={folder / camera}", "--source", f"{name}={folder / sources[name]}"]
    run = subprocess.run([*command, *more], capture_output=True, text=True, check=False)
    assert run.returncode in (0, 1), (command, run.returncode, run.stderr)
    return [json.loads(line) for line in run.stdout.splitlines()], run


def matrix(transform):
    return np.array(transform["matrix"])


def quaternion_matrix(x, y, z, w):
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def as_matrix(translation, rotation):
    result = np.eye(4)
    result[:3, :3] = quaternion_matrix(rotation.x, rotation.y, rotation.z, rotation.w)
    result[:3, 3] = translation.x, translation.y, translation.z
    return result


def apart(a, b):
    """Metres and radians between two poses."""
    between = np.linalg.inv(a) @ b
    return np.linalg.norm(between[:3, 3]), math.acos(np.clip((np.trace(between[:3, :3]) - 1) / 2, -1, 1))


def check_poses(events, truth, n_frames, what, place_m=PLACE_M, turn_rad=TURN_RAD):
    for name, true in truth.items():
        frames = [e for e in events if e["event"] == "frame" and e["camera"] == name]
        assert len(frames) == n_frames, (what, name, len(frames))
        worst = np.zeros(2)
        for i, frame in enumerate(frames):
            assert "cam_from_target" in frame, (what, frame)
            expected_s = (samples.START_NS + i * samples.PERIOD_NS) * 1e-9
            assert abs(frame["t_s"] - expected_s) < 1e-6, "the stamp of the header, not the time of recording"
            worst = np.maximum(worst, apart(matrix(frame["cam_from_target"]), true))
        assert worst[0] < place_m and worst[1] < turn_rad, (what, name, worst)
        print(f"{what}: {name}: {len(frames)} frames, at most {1e3 * worst[0]:.2f} mm and {math.degrees(worst[1]):.3f}° from the truth")


def check_tf(path, events):
    """What is in the file against what was said."""
    poses = {(e["camera"], round(e["t_s"] * 1e9)): matrix(e["cam_from_target"]) for e in events if e.get("cam_from_target") and e["event"] == "frame"}
    with path.open("rb") as file:
        reader = SeekingReader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = [(channel.topic, message.log_time, decoded) for _, channel, message, decoded in reader.iter_decoded_messages()]
        definitions = {s.name: s.data.decode() for s in reader.get_summary().schemas.values()}
    seen = 0
    for topic, log_time, message in messages:
        if topic == "/tf":
            for t in message.transforms:
                assert t.header.stamp.sec * 10**9 + t.header.stamp.nanosec == log_time and t.header.frame_id == "tag"
                key = min(poses, key=lambda k: (k[0] != t.child_frame_id, abs(k[1] - log_time)))
                place, turn = apart(np.linalg.inv(poses[key]), as_matrix(t.transform.translation, t.transform.rotation))
                assert place < 1e-9 and turn < 1e-6 and abs(key[1] - log_time) < 1000, (key, log_time, place, turn)
                seen += 1
        elif topic.endswith("/pose"):
            covariance = np.array(message.pose.covariance).reshape(6, 6)
            assert np.allclose(covariance, covariance.T) and (np.linalg.eigvalsh(covariance) > 0).all()
            sigma_m, sigma_rad = np.sqrt(np.diag(covariance)[:3]), np.sqrt(np.diag(covariance)[3:])
            assert (sigma_m < 0.02).all() and (1e-5 < sigma_rad).all() and (sigma_rad < 0.2).all(), "places first, then turns"
    assert seen == len(poses), (seen, len(poses))
    static = [t for topic, _, m in messages if topic == "/tf_static" for t in m.transforms]
    learned = {e["camera"]: matrix(e["cam_from_target"]) for e in events if e["event"] == "learned"}
    for camera, pose in learned.items():
        reference = next(t for t in static if t.child_frame_id == f"{camera}/reference")
        place, turn = apart(np.linalg.inv(pose), as_matrix(reference.transform.translation, reference.transform.rotation))
        assert place < 1e-9 and turn < 1e-6, (camera, place, turn)
        assert any(t.header.frame_id == f"{camera}/reference" and t.child_frame_id == f"{camera}/corrected" for t in static)
    told = [(s.hardware_id, dict((v.key, v.value) for v in s.values)["state"]) for t, _, m in messages if t == "/diagnostics" for s in m.status]
    assert told == [(e["camera"], e["state"]) for e in events if e["event"] == "state"], told
    compare_definitions(definitions)
    compare_with_rosbags(path, len(messages))
    print(f"{path.name}: {len(messages)} messages, {seen} transforms as said, {len(static)} static ones, {len(told)} states")


def compare_definitions(definitions):
    """Every type in the file has the fields that ROS 2 Humble gives it."""
    known = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in definitions.items():
        for part, (_, fields) in get_types_from_msg(text, name).items():
            assert fields == known.fielddefs[part][1], (part, fields, known.fielddefs[part][1])


def compare_with_rosbags(path, n_messages):
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        kinds = {c.topic: c.msgtype for c in reader.connections}
        decoded = [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]
        static = next(c for c in reader.connections if c.topic == "/tf_static")
        assert "TRANSIENT_LOCAL" in str(static.ext.offered_qos_profiles), static.ext.offered_qos_profiles
    assert len(decoded) == n_messages and kinds["/tf"] == "tf2_msgs/msg/TFMessage", kinds


def killed(resight, folder):
    """What was written two seconds before a kill can be read, chunk by chunk."""
    file = folder / "killed.mcap"
    source = folder / "two_cameras_zstd.mcap"
    growing = folder / "growing.mcap"
    growing.write_bytes(source.read_bytes()[:-3000])  # Never closed: the program waits for more.
    command = [resight, "watch", "--target", str(folder / "tag.toml"), "--learn", "20", "--tf", str(file)]
    command += ["--camera", f"gate={source}#/gate/camera_info", "--source", f"gate={growing}#/gate/image_raw"]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.time() + 60
    while not file.exists() or file.stat().st_size < 4000:
        assert time.time() < until, "nothing was written within a minute"
        time.sleep(0.1)
    time.sleep(2.5)
    run.kill()
    run.wait()
    with file.open("rb") as stream:
        found = 0
        reader = NonSeekingReader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        try:
            for _ in reader.iter_decoded_messages(log_time_order=False):
                found += 1
        except Exception as reason:  # The reader says so when there is no end.
            print(f"killed: {type(reason).__name__} after {found} messages")
    assert 20 <= found, found


def main():
    resight = program()
    with tempfile.TemporaryDirectory() as parent:
        folder = pathlib.Path(parent)
        samples.write_all(folder)
        truth = {name: np.array(pose) for name, pose in json.loads((folder / "truth.json").read_text()).items()}
        n = samples.N_FRAMES
        two = "two_cameras_zstd.mcap"
        events, _ = watch(
            resight, folder, {"gate": f"{two}#/gate/camera_info", "yard": f"{two}#/yard/camera_info"},
            {"gate": f"{two}#/gate/image_raw", "yard": f"{two}#/yard/image_raw/compressed"}, "--tf", str(folder / "out.mcap"),
        )
        check_poses(events, {c: truth[c] for c in ("gate", "yard")}, n, two)
        check_tf(folder / "out.mcap", events)
        file = "rosbags_plain.mcap"
        events, _ = watch(resight, folder, {"shed": file}, {"shed": file})
        check_poses(events, {"shed": truth["shed"]}, n, file)
        file = "detections_lz4.mcap"
        for topic in ("/detections", "/tag_detections"):
            events, _ = watch(resight, folder, {"gate": f"{file}#/gate/camera_info/rectified"}, {"gate": f"{file}#{topic}"})
            # Corners of the truth itself: only half a pixel or a turned tag could be wrong.
            check_poses(events, {"gate": truth["gate"]}, n, f"{file}#{topic}", 1e-6, 1e-6)
        for file, name in (("ros1_zstd.mcap", "gate"), ("big_endian.mcap", "yard"), ("foxglove_json.mcap", "gate")):
            events, _ = watch(resight, folder, {name: file}, {name: file})
            check_poses(events, {name: truth[name]}, 4, file)
        killed(resight, folder)


if __name__ == "__main__":
    sys.exit(main())
