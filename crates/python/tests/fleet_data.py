"""A small fleet with its truth, as columns and files: cameras on posts, one of which is knocked at noon, one with a wrong map, one dead."""

import math

import numpy as np

import resight

POINTS_M = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1.5, 0]], dtype=float)
BEGIN_S = 1_780_000_000.0


def _seen(camera, cam_from_target, points_m):
    return camera.project(cam_from_target @ points_m)


def cameras(n):
    """Lenses, poses and the text of the table, in which camera 2 has a point 20 cm off."""
    lines = ["camera,site,longitude_deg,latitude_deg,width_px,height_px,fx_px,fy_px,cx_px,cy_px," + ",".join(f"x{k}_m,y{k}_m,z{k}_m" for k in range(4))]
    made = []
    for i in range(n):
        f = 1000 + 37 * i
        camera = resight.Camera("pinhole", width_px=1920, height_px=1080, fx_px=f, fy_px=f, cx_px=959.5, cy_px=539.5)
        pose = resight.Pose.from_vectors([0.5 + 0.02 * i, -0.4 + 0.03 * i, 0.1], [-0.8, -0.3, 5.0 + 0.2 * i], b="cam", a="target")
        points = POINTS_M.copy()
        if i == 2:
            points[1, 1] += 0.2
        made.append((camera, pose))
        numbers = ",".join(str(x) for x in points.ravel())
        lines.append(f"cam-{i},site-{i // 2},{13.2 + 0.01 * i},{52.5 + 0.003 * i},1920,1080,{f},{f},959.5,539.5,{numbers}")
    return made, "\n".join(lines) + "\n"


def views(n, hours=6.0, every_s=60.0, seed=1, sigma_px=0.3):
    """Columns of a day: camera 1 rotates by 0.2 degrees amid it, camera 3 is dead after a third of it; some rows are poison."""
    rng = np.random.default_rng(seed)
    made, text = cameras(n)
    ticks = int(hours * 3600 / every_s)
    turned = resight.Pose.from_vectors([0, math.radians(0.2), 0], [0, 0, 0], b="cam", a="cam")
    pixels, times, names = [], [], []
    for i, (camera, pose) in enumerate(made):
        before, after = _seen(camera, pose, POINTS_M), _seen(camera, turned @ pose, POINTS_M)
        last = ticks // 3 if i == 3 else ticks
        t = np.arange(last)
        moved = (i == 1) & (ticks // 2 <= t)
        pixels.append(np.where(moved[:, None, None], after, before) + rng.normal(0, sigma_px, (last, 4, 2)))
        times.append(BEGIN_S + t * every_s)
        names += [f"cam-{i}"] * last
    pixels, times, names = np.concatenate(pixels), np.concatenate(times), np.array(names, dtype=object)
    order = np.lexsort((names.astype(str), times))
    pixels, times, names = pixels[order], times[order], names[order]
    pixels[7, 2, 0], pixels[11, 1, 1] = math.nan, 1e300
    names[13], names[17] = "cam-unheard-of", None
    table = {"camera": names, "time_s": times, "view": np.array([f"v{i:06d}" for i in range(len(names))], dtype=object)}
    for k in range(4):
        table[f"u{k}_px"], table[f"v{k}_px"] = np.ascontiguousarray(pixels[:, k, 0]), np.ascontiguousarray(pixels[:, k, 1])
    return table, text


def write(folder, n=6, files=3, **of):
    """`cameras.csv` and `views/N.parquet`; the table of the views."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns, text = views(n, **of)
    (folder / "cameras.csv").write_text(text)
    (folder / "views").mkdir()
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    size = -(-len(table) // files)
    for i in range(files):
        pq.write_table(table.slice(i * size, size), folder / "views" / f"{i}.parquet", row_group_size=max(1, size // 4))
    return table
