"""A NetworkTables server of WPILib's own library reads what `resight watch --nt4` publishes.

    python scripts/judges/networktables.py

A session of the program is fed with dots seen by a camera that is knocked. The server must have each pose as the structure `Pose3d`, in its own
time, with its standard deviations, and the last states, among them that the camera moved; the pose must be that of the line of JSON of the last
frame, in the axes of WPILib. Needs pyntcore, robotpy-wpimath, and what watch_told.py needs.
"""

import pathlib
import tempfile

import ntcore
import numpy as np
from watch_told import Session, free_port, lines, program, wait_for
from wpimath.geometry import Pose3d, Quaternion, Rotation3d, Translation3d

# The camera of WPILib looks along x, with y to the left and z up: its axes in those of the image.
OPTICAL_FROM_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def as_matrix(pose):
    return np.array(pose.toMatrix())


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        server = ntcore.NetworkTableInstance.create()
        port = free_port()
        server.startServer(str(folder / "persistent.json"), "127.0.0.1", free_port(), port)
        table = server.getTable("resight").getSubTable("gate")
        pair = table.getSubTable("dots")
        poses = pair.getStructTopic("target_from_cam", Pose3d).subscribe(Pose3d(), ntcore.PubSubOptions(sendAll=True, pollStorage=1000))
        sigma = pair.getDoubleArrayTopic("sigma").subscribe([])
        state, moved = pair.getStringTopic("state").subscribe(""), pair.getBooleanTopic("moved").subscribe(False)
        connected = table.getBooleanTopic("connected").subscribe(False)
        session = Session(program(), folder, "--frames", "--nt4", f"127.0.0.1:{port}")
        session.told("connected")
        before_us = ntcore._now()
        session.feed(lines(range(100), 0.0))
        session.feed(lines(range(100, 140), 2.0))
        wait_for("the alarm", moved.get)
        frames = lambda: [event for event in list(session.events) if event["event"] == "frame"]
        wait_for("140 frames", lambda: len(frames()) == 140)
        last = wait_for("the last pose", lambda: (lambda p: p if p.time > 0 else None)(poses.getAtomic()))
        assert connected.get() and state.get() == "drifted", (connected.get(), state.get())
        n_poses = len(poses.readQueue())
        assert 100 <= n_poses <= 140, n_poses
        assert before_us <= last.serverTime <= ntcore._now(), (before_us, last.serverTime)
        written = frames()[-1]["cam_from_target"]
        w, x, y, z = written["quaternion_wxyz"]
        cam_from_target = np.array(Pose3d(Translation3d(*written["translation_m"]), Rotation3d(Quaternion(w, x, y, z))).toMatrix())
        expected = np.linalg.inv(cam_from_target)
        expected[:3, :3] = expected[:3, :3] @ OPTICAL_FROM_BODY
        off = np.abs(as_matrix(wait_for("a pose", poses.get)) - expected).max()
        assert off < 1e-6, off
        assert len(sigma.get()) == 6 and all(0 < s < 0.1 for s in sigma.get()), sigma.get()
        session.end()
        wait_for("the end of the topics", lambda: not pair.getTopic("state").exists())
        ntcore.NetworkTableInstance.destroy(server)
    print(f"networktables: {n_poses} poses of 140 frames, the last within {off:.1e} of its line; the alarm; no topic after the end")


if __name__ == "__main__":
    main()
