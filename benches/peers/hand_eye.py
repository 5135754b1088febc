"""Where a camera sits on a robot: Resight against the seven methods of OpenCV, on the same corners and hand poses, judged on views that nobody solved with.

A session has 40 to 55 views of a board of 7 × 8 corners (0.1 px) from all over a cap of 45 degrees, 0.6 to 1.2 m away, and 20 held-out views of the
same kind. The robot reports its poses with noise: at the hand (orientation and position independently) or in the base (a motion about the base's
origin). Resight gets pixels and reported poses and is told nothing about the robot; OpenCV gets the pose of every view (SQPNP + RefineLM). Of
calibrateHandEye, which finds the camera alone, the target is the mean over the views.

Two tables. Both predict the corners of the held-out views, root mean square in pixels over all sessions: from the reported hand poses, which the robot's own
noise dominates, and from the true ones, which leaves the error of the calibration. `--check` ends with status 1 where a method of OpenCV is
better by more than the tolerance stated there.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

CAMERA = np.array([[800.0, 0, 319.5], [0, 800.0, 239.5], [0, 0, 1]])
SIGMA_PX, HELD_OUT = 0.1, 20
BOARD = np.array([[0.03 * (i % 8 - 3.5), 0.03 * (i // 8 - 3.0), 0.0] for i in range(56)])
ROBOTS = [  # name, where, rad, m
    ("0.2° and 1 mm at the hand", "hand", np.radians(0.2), 1e-3),
    ("0.2° and 1 mm in the base", "base", np.radians(0.2), 1e-3),
    ("0.1° and 0.3 mm at the hand", "hand", np.radians(0.1), 3e-4),
    ("0.05° and 0.2 mm in the base", "base", np.radians(0.05), 2e-4),
    ("0.02° and 0.1 mm at the hand", "hand", np.radians(0.02), 1e-4),
    ("2 mm in position only", "hand", 0.0, 2e-3),
    ("exact", "hand", 0.0, 0.0),
]
HAND_EYE = ["Tsai", "Park", "Horaud", "Andreff", "Daniilidis"]
ROBOT_WORLD = ["Shah", "Li"]
OURS = "**Resight**"
# Of the least error among OpenCV's: on views predicted from reported poses, and from the true ones.
TOLERANCE = {"reported": 1.002, "true": 1.02}


def pose(rotation_vector, translation):
    m = np.eye(4)
    m[:3, :3] = cv2.Rodrigues(np.asarray(rotation_vector, float))[0]
    m[:3, 3] = translation
    return m


def random_rotation(rng):
    q = rng.standard_normal(4)
    w, v = q[0] / np.linalg.norm(q), q[1:] / np.linalg.norm(q)
    hat = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * hat + 2 * hat @ hat


def looking(rng):
    """cam_from_target of a camera on the cap, turned a little aside."""
    tilt, turn, away_m = rng.uniform(0, 0.8), rng.uniform(0, 2 * np.pi), rng.uniform(0.6, 1.2)
    centre = away_m * np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    z = -centre / np.linalg.norm(centre)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    facing = np.eye(4)
    facing[:3, :3] = [x, np.cross(z, x), z]
    facing[:3, 3] = -facing[:3, :3] @ centre
    aside = [rng.uniform(-0.12, 0.12), rng.uniform(-0.2, 0.2), 0]
    return pose(aside, [0, 0, 0]) @ pose([0, 0, rng.uniform(-1, 1)], [0, 0, 0]) @ facing


def reported(rng, truth, where, sigma_rad, sigma_m):
    turn, shift = sigma_rad * rng.standard_normal(3), sigma_m * rng.standard_normal(3)
    if where == "base":
        return pose(turn, shift) @ truth
    out = pose(turn, [0, 0, 0]) @ truth
    out[:3, 3] = truth[:3, 3] + shift
    return out


def projected(cam_from_target):
    x = BOARD @ cam_from_target[:3, :3].T + cam_from_target[:3, 3]
    return x[:, :2] / x[:, 2:] * CAMERA[0, 0] + CAMERA[:2, 2]


def session(rng, n, robot, target_on_hand):
    """Views: true and reported `carrier_from_holder`, pixels."""
    x = np.eye(4)
    x[:3, :3], away = random_rotation(rng), rng.standard_normal(3)
    x[:3, 3] = 0.15 * away / np.linalg.norm(away)
    z = np.eye(4)
    z[:3, :3], z[:3, 3] = random_rotation(rng), [0.8, -0.3, 0.2]
    views = []
    for _ in range(n + HELD_OUT):
        t = looking(rng)
        h = np.linalg.inv(x) @ t @ np.linalg.inv(z)
        base_from_hand = h if target_on_hand else np.linalg.inv(h)
        said = reported(rng, base_from_hand, *robot)
        pixels = projected(t) + SIGMA_PX * rng.standard_normal((len(BOARD), 2))
        views.append({"h": h, "said": said, "said_h": said if target_on_hand else np.linalg.inv(said), "pixels": pixels})
    return x, z, views[:n], views[n:]


# ---- the contenders: cam_from_carrier and holder_from_target


def written(path, views, target_on_hand):
    lines = [f"sigma_px,{SIGMA_PX}", f"c,{CAMERA[0, 0]},{CAMERA[1, 1]},{CAMERA[0, 2]},{CAMERA[1, 2]}"]
    lines += ["target_on_hand"] if target_on_hand else []
    for view in views:
        m = view["said"]
        vector = cv2.Rodrigues(m[:3, :3])[0].ravel()
        angle = np.linalg.norm(vector)
        axis = vector / angle if 0 < angle else vector
        q = [np.cos(angle / 2), *(np.sin(angle / 2) * axis)]
        lines.append("h," + ",".join(f"{v:.17g}" for v in [*q, *m[:3, 3]]))
    for i, view in enumerate(views):
        lines += ["s,%d,%.17g,%.17g,%.17g,%.17g,%.17g" % (i, *p, *px) for p, px in zip(BOARD, view["pixels"])]
    path.write_text("\n".join(lines) + "\n")


def resight(program, path):
    run = subprocess.run([program, str(path)], check=True, capture_output=True, text=True)
    found = json.loads(run.stdout)
    full = lambda rows: np.vstack([rows, [0, 0, 0, 1]])
    return full(found["cam_from_carrier"]), full(found["holder_from_target"]), found["is_inconsistent"]


def single_poses(views):
    poses = []
    for view in views:
        _, rvec, tvec = cv2.solvePnP(BOARD, view["pixels"], CAMERA, None, flags=cv2.SOLVEPNP_SQPNP)
        rvec, tvec = cv2.solvePnPRefineLM(BOARD, view["pixels"], CAMERA, None, rvec, tvec)
        poses.append(pose(rvec.ravel(), tvec.ravel()))
    return poses


def mean_pose(poses):
    u, _, vt = np.linalg.svd(np.mean([p[:3, :3] for p in poses], axis=0))
    m = np.eye(4)
    m[:3, :3] = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    m[:3, 3] = np.mean([p[:3, 3] for p in poses], axis=0)
    return m


def opencv(views):
    """With the holder for OpenCV's base and the carrier for its gripper, both mountings are its camera on the hand."""
    seen = single_poses(views)
    r, t = (lambda poses: [p[:3, :3] for p in poses]), (lambda poses: [p[:3, 3].reshape(3, 1) for p in poses])
    h = [view["said_h"] for view in views]
    inverse = [np.linalg.inv(p) for p in h]
    for name in HAND_EYE:
        method = getattr(cv2, f"CALIB_HAND_EYE_{name.upper()}")
        rotation, place = cv2.calibrateHandEye(r(inverse), t(inverse), r(seen), t(seen), method=method)
        carrier_from_cam = np.eye(4)
        carrier_from_cam[:3, :3], carrier_from_cam[:3, 3] = rotation, place.ravel()
        yield name, np.linalg.inv(carrier_from_cam), mean_pose([i @ carrier_from_cam @ s for i, s in zip(inverse, seen)])
    for name in ROBOT_WORLD:
        # Its world is the target's frame, its base the holder's: A X = Z B with A = cam_from_target, B = carrier_from_holder.
        method = getattr(cv2, f"CALIB_ROBOT_WORLD_HAND_EYE_{name.upper()}")
        rb, tb, rg, tg = cv2.calibrateRobotWorldHandEye(r(seen), t(seen), r(h), t(h), method=method)
        target_from_holder, cam_from_carrier = np.eye(4), np.eye(4)
        target_from_holder[:3, :3], target_from_holder[:3, 3] = rb, tb.ravel()
        cam_from_carrier[:3, :3], cam_from_carrier[:3, 3] = rg, tg.ravel()
        yield name, cam_from_carrier, np.linalg.inv(target_from_holder)


def held_out_squares(x, z, views, key):
    """Mean over views and corners of the squared distance in the image."""
    return np.mean([np.mean(np.sum((projected(x @ view[key] @ z) - view["pixels"]) ** 2, axis=1)) for view in views])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="the example bench_hand_eye")
    parser.add_argument("--folder", type=Path, required=True, help="for the sessions")
    parser.add_argument("--sessions", type=int, default=40, help="of each robot, half of them with the target on the hand")
    parser.add_argument("--check", action="store_true", help="exit status 1 where a method of OpenCV is better")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    names = [OURS, *HAND_EYE, *ROBOT_WORLD]
    rows, is_worse = [], False
    for number, (title, *robot) in enumerate(ROBOTS):
        rng = np.random.default_rng(100 + number)
        squares = {name: {"reported": [], "true": [], "place": []} for name in names}
        n_inconsistent = 0
        for trial in range(arguments.sessions):
            n, target_on_hand = 40 + trial * 15 // max(arguments.sessions - 1, 1), trial % 2 == 1
            truth, _, views, held_out = session(rng, n, robot, target_on_hand)
            path = arguments.folder / "hand_eye.csv"
            written(path, views, target_on_hand)
            *ours, inconsistent = resight(arguments.program, path)
            n_inconsistent += inconsistent
            for name, x, z in [(OURS, *ours), *opencv(views)]:
                squares[name]["reported"].append(held_out_squares(x, z, held_out, "said_h"))
                squares[name]["true"].append(held_out_squares(x, z, held_out, "h"))
                squares[name]["place"].append(np.sum((np.linalg.inv(x)[:3, 3] - np.linalg.inv(truth)[:3, 3]) ** 2))
        rms = {name: {key: np.sqrt(np.mean(all)) for key, all in of.items()} for name, of in squares.items()}
        rows.append((title, rms, n_inconsistent))
        for key, tolerance in TOLERANCE.items():
            best = min((rms[name][key], name) for name in names[1:])
            if tolerance * best[0] < rms[OURS][key]:
                is_worse = True
                print(f"{title}, {key} hand poses: {best[1]} {best[0]:.4f} px, Resight {rms[OURS][key]:.4f} px", file=sys.stderr)
    print(f"{arguments.sessions} sessions a robot, {HELD_OUT} held-out views each; OpenCV {cv2.__version__}")
    tables = [
        ("corners predicted from the reported hand poses, px", "reported", 1, 3),
        ("corners predicted from the true hand poses, px", "true", 1, 3),
        ("position of the camera on its carrier, mm", "place", 1e3, 2),
    ]
    for title, key, unit, digits in tables:
        print(f"\nHeld-out: {title}\n" if key != "place" else f"\nError of the {title}\n")
        print("| robot | " + " | ".join(names) + " |\n| --- |" + " ---: |" * len(names))
        for robot, rms, _ in rows:
            print(f"| {robot} | " + " | ".join(f"{unit * rms[name][key]:.{digits}f}" for name in names) + " |")
    print(f"\nSessions that Resight calls inconsistent: {sum(row[2] for row in rows)} of {len(rows) * arguments.sessions}.")
    sys.exit(1 if arguments.check and is_worse else 0)


if __name__ == "__main__":
    main()
