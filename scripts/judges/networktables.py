"""A NetworkTables server of WPILib's own library reads what `resight watch --nt4` publishes.

    python scripts/judges/networktables.py

A session of the program is fed with dots seen by a camera that is knocked. The server must have each pose as the structure `Pose3d`, in its own
time, with its standard deviations, and the last states, among them that the camera moved; the pose, which is that of a frame alone, must be near the
tracked one in the line of JSON of the last frame, in the axes of WPILib. Needs pyntcore, robotpy-wpimath, and what watch_told.py needs.
"""

import pathlib
import tempfile

import ntcore
import numpy as np
from watch_told import Session, answers, free_port, lines, program, wait_for
from wpimath.geometry import Pose3d

# The camera of WPILib looks along x, with y to the left and z up: its axes in those of the image.
OPTICAL_FROM_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        server = ntcore.NetworkTableInstance.create()
        port = free_port()
        server.startServer(str(folder / "persistent.json"), "127.0.0.1", free_port(), port)
        wait_for("the server", lambda: answers(port))
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
        came = []
        wait_for("140 poses", lambda: came.extend(poses.readQueue()) or len(came) == 140)
        last = came[-1]
        assert connected.get() and state.get() == "drifted", (connected.get(), state.get())
        # The server's time is known to half of the time that its answer took.
        within_us = 100_000
        times_us = [before_us, came[0].serverTime, last.serverTime, ntcore._now()]
        assert all(a <= b + within_us for a, b in zip(times_us, times_us[1:])), times_us
        expected = np.linalg.inv(np.array(frames()[-1]["cam_from_target"]["matrix"]))
        expected[:3, :3] = expected[:3, :3] @ OPTICAL_FROM_BODY
        off = np.abs(np.array(last.value.toMatrix()) - expected).max()
        assert off < 0.01, off
        assert len(sigma.get()) == 6 and all(0 < s < 0.1 for s in sigma.get()), sigma.get()
        session.end()
        wait_for("the end of the topics", lambda: not pair.getTopic("state").exists())
        ntcore.NetworkTableInstance.destroy(server)
    print(f"networktables: 140 poses, the last within {off:.1e} of its line; the alarm; no topic after the end")


if __name__ == "__main__":
    main()
