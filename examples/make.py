"""Writes the simulated files of examples/: robot, gate, marks, marked_lines, rig and walk. Needs NumPy. Run it in this folder: python make.py"""

import json
from pathlib import Path

import numpy as np

chance = np.random.default_rng(7)
F_PX, CX_PX, CY_PX = 900.0, 639.5, 479.5
CAMERA = f'model = "pinhole"\nwidth_px = 1280\nheight_px = 960\nfx_px = {F_PX}\nfy_px = {F_PX}\ncx_px = {CX_PX}\ncy_px = {CY_PX}\n'


def rotation(vector):
    """Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def pose(vector, translation_m):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation(vector), translation_m
    return matrix


def quaternion_wxyz(r):
    """Of a rotation by less than half a turn."""
    w = 0.5 * np.sqrt(1.0 + np.trace(r))
    return [w, (r[2, 1] - r[1, 2]) / (4 * w), (r[0, 2] - r[2, 0]) / (4 * w), (r[1, 0] - r[0, 1]) / (4 * w)]


def pixels(cam_from_target, points_m, sigma_px):
    x = points_m @ cam_from_target[:3, :3].T + cam_from_target[:3, 3]
    assert (x[:, 2] > 0).all()
    uv = F_PX * x[:, :2] / x[:, 2:] + [CX_PX, CY_PX]
    return uv + chance.normal(0.0, sigma_px, uv.shape)


def walk():
    """A camera carried once round a room of 6 m x 4 m with 24 tags on its walls; a day later a shorter walk, tag 5 moved by 0.3 m, tag 24 new."""
    chance = np.random.default_rng(42)
    size_m, sigma_px, sides = 0.165, 0.3, [(6.0, 0.0), (4.0, 90.0), (6.0, 180.0), (4.0, 270.0)]

    def along(share):
        """A place on the walls, and the direction out of the room."""
        at, corner = share % 1.0 * 20.0, np.array([-3.0, -2.0])
        for length, heading in sides:
            a = np.radians(heading)
            step = np.array([np.cos(a), np.sin(a)])
            if at <= length:
                return corner + at * step, np.array([step[1], -step[0]])
            at, corner = at - length, corner + length * step

    def tag(share, height_m):
        place, out = along(share)
        z = np.array([*out, 0.0]) + chance.normal(0.0, 0.1, 3)
        z /= np.linalg.norm(z)
        y = np.array([0.0, 0.0, -1.0]) + z[2] * z
        y /= np.linalg.norm(y)
        world_from_tag = np.eye(4)
        world_from_tag[:3, :3], world_from_tag[:3, 3] = np.column_stack([np.cross(y, z), y, z]), [*place, height_m]
        return world_from_tag

    def look(share):
        wall, out = along(share + chance.uniform(-0.01, 0.01))
        centre = np.array([*(wall - out * chance.uniform(2.0, 2.6)), chance.uniform(1.2, 1.7)])
        aim = np.array([*along(share + chance.uniform(-0.05, 0.05))[0], 1.4])
        z = (aim - centre) / np.linalg.norm(aim - centre)
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        cam_from_world = np.eye(4)
        cam_from_world[:3, :3] = np.vstack([x, np.cross(z, x), z])
        cam_from_world[:3, 3] = -cam_from_world[:3, :3] @ centre
        return cam_from_world

    h = 0.5 * size_m
    corners_m = np.array([[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]])

    def rows(shares, tags):
        rows = ["view,id,corner,u_px,v_px,sigma_px"]
        for view, share in enumerate(shares):
            cam_from_world = look(share)
            for id, world_from_tag in tags.items():
                cam_from_tag = cam_from_world @ world_from_tag
                t = cam_from_tag[:3, 3]
                if t[2] < 0.5 or cam_from_tag[:3, 2] @ t < 0.35 * np.linalg.norm(t):
                    continue
                x = corners_m @ cam_from_tag[:3, :3].T + t
                uv = F_PX * x[:, :2] / x[:, 2:] + [CX_PX, CY_PX] + chance.normal(0.0, sigma_px, (4, 2))
                if ((uv > 5.0) & (uv < [1274.0, 954.0])).all():
                    rows += [f"{view:02},{id},{c},{u:.2f},{v:.2f},{sigma_px}" for c, (u, v) in enumerate(uv)]
        return "\n".join(rows) + "\n"

    tags = {id: tag((id + 0.5) / 24, (1.1, 1.9, 1.5)[id % 3]) for id in range(24)}
    Path("walk/camera.toml").write_text(CAMERA)
    Path("walk/corners.csv").write_text(rows(np.arange(44) / 40, tags))
    tags[5] = tags[5] @ pose([0.0, 0.0, 0.1], [0.3, 0.0, 0.0])
    tags[24] = tag(0.3, 2.0)
    Path("walk/later.csv").write_text(rows(0.2 + np.arange(14) / 56, tags))
    truth = {id: [*quaternion_wxyz_any(t[:3, :3]), *t[:3, 3]] for id, t in tags.items()}
    Path("walk/truth.csv").write_text(
        "id,qw,qx,qy,qz,x_m,y_m,z_m\n" + "".join(f"{id}," + ",".join(f"{n:.7f}" for n in t) + "\n" for id, t in truth.items())
    )


def quaternion_wxyz_any(r):
    """Of any rotation, by its largest component."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)]])
    x, y, z, w = np.linalg.eigh(k / 3)[1][:, -1]
    return np.array([w, x, y, z]) * np.sign(w if w else 1.0)


def robot():
    """A camera on a gripper before a board of 4 × 5 corners; the robot is exact to 0.1° and 0.3 mm."""
    corners_m = np.array([[0.03 * c, 0.03 * r, 0.0] for r in range(4) for c in range(5)])
    cam_from_gripper = pose([0.02, -0.03, 1.55], [0.04, -0.02, 0.07])
    base_from_target = pose([0.0, 0.0, 0.3], [0.6, 0.1, 0.0])
    motions, rows = ["view,qw,qx,qy,qz,x_m,y_m,z_m"], ["camera,view,id,x_m,y_m,z_m,u_px,v_px,sigma_px"]
    for i in range(15):
        tilt = rotation(chance.uniform(-0.45, 0.45, 3)) @ rotation([0.0, 0.0, chance.uniform(-0.5, 0.5)])
        cam_from_target = np.eye(4)
        cam_from_target[:3, :3] = tilt
        cam_from_target[:3, 3] = -tilt @ [0.06, 0.045, 0.0] + chance.uniform([-0.05, -0.04, 0.35], [0.05, 0.04, 0.5])
        base_from_gripper = base_from_target @ np.linalg.inv(cam_from_target) @ cam_from_gripper
        noise = pose(chance.normal(0.0, np.radians(0.1), 3), chance.normal(0.0, 0.0003, 3))
        reported = base_from_gripper @ noise
        numbers = [*quaternion_wxyz(reported[:3, :3]), *reported[:3, 3]]
        motions.append(f"{i}," + ",".join(f"{n:.7f}" for n in numbers))
        for corner, (x, uv) in enumerate(zip(corners_m, pixels(cam_from_target, corners_m, 0.1))):
            rows.append(f"cam,{i},{corner},{x[0]:.3f},{x[1]:.3f},0,{uv[0]:.3f},{uv[1]:.3f},0.1")
    Path("robot/motions.csv").write_text("\n".join(motions) + "\n")
    Path("robot/corners.csv").write_text("\n".join(rows) + "\n")
    Path("robot/camera.toml").write_text(CAMERA)


def gate():
    """A tag of 160 mm at 2 m, once a second; after 80 s the camera turns right by 0.5°. The next night it is still turned."""
    half = 0.08
    corners_m = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    steady = pose([0.35, 0.5, 0.05], [0.1, -0.05, 2.0])
    turned = pose([0.0, -np.radians(0.5), 0.0], [0, 0, 0]) @ steady

    def line(t_s, cam_from_tag):
        seen = [
            {"id": 3, "corner": c, "u_px": round(float(u), 3), "v_px": round(float(v), 3), "sigma_px": 0.1}
            for c, (u, v) in enumerate(pixels(cam_from_tag, corners_m, 0.1))
        ]
        return json.dumps({"camera": "gate", "t_s": t_s, "detections": seen}, separators=(",", ":"))

    day = [line(float(t), turned if t >= 80 else steady) for t in range(100)]
    Path("gate/day.jsonl").write_text("\n".join(day) + "\n")
    night = [line(43200.0 + t, turned) for t in range(20)]
    Path("gate/night.jsonl").write_text("\n".join(night) + "\n")
    Path("gate/gate.toml").write_text(CAMERA)
    Path("gate/tag.toml").write_text('kind = "tag"\nfamily = "tag36h11"\nid = 3\nsize_m = 0.16\n')


def marks():
    """Six surveyed marks on a road, seen by a camera 4 m above it."""
    marks_m = np.array([[-2.0, 8.0, 0], [2.5, 9.0, 0], [0.5, 12.0, 0.4], [-3.0, 15.0, 0], [4.0, 16.0, 0], [0.0, 20.0, 0.8]])
    # Camera x to the right, y down, z forward: 20° below the horizon along the road's y axis.
    dip = np.radians(20.0)
    r = np.array([[1, 0, 0], [0, -np.sin(dip), -np.cos(dip)], [0, np.cos(dip), -np.sin(dip)]])
    cam_from_road = np.eye(4)
    cam_from_road[:3, :3], cam_from_road[:3, 3] = r, -r @ [0.0, 0.0, 4.0]
    rows = ["id,x_m,y_m,z_m,u_px,v_px,sigma_px"]
    for i, (x, uv) in enumerate(zip(marks_m, pixels(cam_from_road, marks_m, 0.3))):
        rows.append(f"m{i},{x[0]},{x[1]},{x[2]},{uv[0]:.2f},{uv[1]:.2f},0.3")
    Path("marks/marks.csv").write_text("\n".join(rows) + "\n")
    swapped = rows[:]  # Two labels exchanged, as happens in the field.
    for a, b in [(2, 5)]:
        u = [row.split(",") for row in (rows[a], rows[b])]
        swapped[a] = ",".join(u[0][:4] + u[1][4:])
        swapped[b] = ",".join(u[1][:4] + u[0][4:])
    more_m = np.array([[chance.uniform(-5, 5), chance.uniform(8, 25), chance.uniform(0, 1)] for _ in range(14)])
    for i, (x, uv) in enumerate(zip(more_m, pixels(cam_from_road, more_m, 0.3))):
        swapped.append(f"n{i},{x[0]:.3f},{x[1]:.3f},{x[2]:.3f},{uv[0]:.2f},{uv[1]:.2f},0.3")
    Path("marks/swapped.csv").write_text("\n".join(swapped) + "\n")
    Path("marks/camera.toml").write_text(CAMERA)


def marked_lines():
    """Kerbs, a stop line, posts: a road from 6.2 m, f = 980 px, k1 = -0.06, the principal point off the middle; marks to 0.8 px."""
    lines = [
        ("left kerb", "along", (1.2, 15, 0), (1.2, 50, 0)),
        ("lane line", "along", (4.7, 14, 0), (4.7, 60, 0)),
        ("right kerb", "along", (8.2, 17, 0), (8.2, 60, 0)),
        ("stop line", "across", (1.2, 17, 0), (8.2, 17, 0)),
        ("crossing", "across", (1.2, 26, 0), (8.2, 26, 0)),
        ("bus bay", "across", (1.2, 40, 0), (11, 40, 0)),
        ("lamp post", "up", (10, 24, 0), (10, 24, 5)),
        ("sign", "up", (0.6, 22, 0), (0.6, 22, 2.5)),
        ("house corner", "up", (15, 38, 0), (15, 38, 7)),
    ]
    tilt, roll, heading, height_m = np.radians(14), np.radians(-2), np.radians(18), 6.2
    level = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    r = rotation([0, 0, -roll]) @ rotation([tilt, 0, 0]) @ level @ rotation([0, 0, heading])
    rows = ["id,direction,u_px,v_px,u2_px,v2_px,length_m,length_sigma_m"]
    for name, direction, *ends in lines:
        x = (np.array(ends, float) - [0, 0, height_m]) @ r.T
        q = x[:, :2] / x[:, 2:]
        uv = 980 * q * (1 - 0.06 * (q**2).sum(1, keepdims=True)) + [652, 351] + chance.normal(0, 0.8, (2, 2))
        length = "7,0.05" if name == "stop line" else ","
        rows.append(f"{name},{direction},{uv[0, 0]:.1f},{uv[0, 1]:.1f},{uv[1, 0]:.1f},{uv[1, 1]:.1f},{length}")
    Path("marked_lines/road.csv").write_text("\n".join(rows) + "\n")


def rig():
    """Four cameras around a place where a board of 5 × 4 corners is held 24 times; noise of 0.3 px. In view 09 the board had moved between
    the images of two cameras, and one corner in sixty is wrong by 4 to 12 px."""
    corners_m = np.array([[0.06 * c, 0.06 * r, 0.0] for r in range(4) for c in range(5)])
    middle_m = corners_m.mean(axis=0)
    names, cameras = ["front", "left", "rear", "right"], []
    # The frame of the rig is that of `front`: x to the right, y down, z forward; the others look at a point 1.6 m ahead of it.
    for turned_rad, height_m, distance_m in [(0.0, 0.0, 1.6), (0.9, -0.35, 1.5), (2.1, -0.15, 1.9), (-0.9, 0.25, 1.4)]:
        centre = np.array([0.0, 0.0, 1.6]) + distance_m * np.array([-np.sin(turned_rad), 0.0, -np.cos(turned_rad)]) + [0.0, height_m, 0.0]
        ahead = np.array([0.0, 0.0, 1.6]) - centre
        ahead /= np.linalg.norm(ahead)
        across = np.cross([0.0, 1.0, 0.0], ahead)
        across /= np.linalg.norm(across)
        cam_from_rig = np.eye(4)
        cam_from_rig[:3, :3] = np.array([across, np.cross(ahead, across), ahead])
        cam_from_rig[:3, 3] = -cam_from_rig[:3, :3] @ centre
        cameras.append(cam_from_rig)
    rows = ["camera,view,id,x_m,y_m,z_m,u_px,v_px,sigma_px"]
    for view in range(24):
        # Held between two cameras and seen by those that it does not face away from.
        facing = rotation([0.0, [0.45, 1.5, -0.45][view % 3], 0.0])
        rig_from_board = np.eye(4)
        rig_from_board[:3, :3] = facing @ rotation(chance.uniform(-0.5, 0.5, 3))
        rig_from_board[:3, 3] = np.array([0.0, 0.0, 1.6]) + chance.uniform(-0.18, 0.18, 3) - rig_from_board[:3, :3] @ middle_m
        for i, (name, cam_from_rig) in enumerate(zip(names, cameras)):
            cam_from_board = cam_from_rig @ rig_from_board
            if cam_from_board[2, 2] < 0.35:
                continue
            if view == 9 and i == 1:
                cam_from_board = cam_from_board @ pose([0.0, 0.2, 0.1], [0.08, 0.04, 0.0])
            for corner, (x, uv) in enumerate(zip(corners_m, pixels(cam_from_board, corners_m, 0.3))):
                if chance.uniform() < 1 / 60:
                    uv = uv + chance.uniform(4, 12) * np.array([1.0, -1.0])
                if 0 <= uv[0] < 1280 and 0 <= uv[1] < 960:
                    rows.append(f"{name},{view:02},{corner},{x[0]:.2f},{x[1]:.2f},0,{uv[0]:.2f},{uv[1]:.2f},0.3")
    Path("rig/detections.csv").write_text("\n".join(rows) + "\n")
    Path("rig/cameras.toml").write_text("".join(f'[[camera]]\nname = "{name}"\n{CAMERA}\n' for name in names))


robot()
gate()
marks()
marked_lines()
rig()
walk()
