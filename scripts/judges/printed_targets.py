"""Printed targets, read by others: PDFium and resvg rasterise what `resight print` writes, Resight and OpenCV find every corner.

    python scripts/judges/printed_targets.py [--save FOLDER]       needs the program: $RESIGHT, or target/release or target/debug

Each kind at 150 and 300 dpi: every corner is found, the scale of either axis is right to 0.02 %, and no axis has a bias above 0.05 px. The
pages themselves are as large as their paper, and the viewer is told not to scale them.

All are read as rasterised, without the blur of a lens. OpenCV finds corners of tags by lines along rows of pixels, where they scatter by 0.1 px: its
bar for the scale of twelve tags is 0.04 %, of a lone one 0.2 %, of the bias 0.1 px.
"""

import io
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np
import pypdfium2
import resvg_py
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[2]
CANDIDATES = [os.environ.get("RESIGHT", ""), ROOT / "target/release/resight", ROOT / "target/debug/resight"]
PROGRAM = next((str(p) for p in CANDIDATES if p and pathlib.Path(p).is_file()), None)
SCALE, BIAS_PX = 2e-4, 0.05
OPENCV_TAGS = {True: (4e-4, 0.1), False: (2e-3, 0.1)}  # twelve, or a lone one
# A reader finds a corner of a razor-sharp raster to some hundredths of a pixel; sheets of twelve tags average that, one tag alone does not.
FAMILIES = {
    "tag36h11": "0.02",
    "tag25h9": "0.02",
    "tag16h5": "0.02",
    "tagStandard41h12": "0.012",
    "tagStandard52h13": "0.012",
    "tagCircle21h7": "0.012",
    "tagCircle49h12": "0.012",
    "tagCustom48h12": "0.012",
    "DICT_4X4_50": "0.02",
    "DICT_6X6_250": "0.02",
    "DICT_ARUCO_ORIGINAL": "0.02",
}
KINDS = {family: f"--kind tag --family {family} --id 0-11 --size-m {size}" for family, size in FAMILIES.items()} | {
    "tag": "--kind tag --id 7 --size-m 0.02",
    "aprilgrid": "--kind aprilgrid --rows 4 --columns 3 --tag-size-m 0.04 --tag-spacing-ratio 0.3",
    "chessboard": "--kind chessboard --rows 6 --columns 9 --square-m 0.025",
    "charuco": "--kind charuco --rows 7 --columns 5 --square-m 0.03 --marker-m 0.022 --dictionary DICT_5X5_100",
    "dots": "--kind line_plus_one --line-m 0,0.1,0.15 --off-m 0,0.15",
}
# Cells of both rims over cells of the square, as the families' makers state them: what a sheet leaves between tags, beside 0.15 of the size.
RIMS = {
    "tag36h11": 2 / 8,
    "tag25h9": 2 / 7,
    "tag16h5": 2 / 6,
    "tagStandard41h12": 4 / 5,
    "tagStandard52h13": 4 / 6,
    "tagCircle21h7": 4 / 5,
    "tagCircle49h12": 6 / 5,
    "tagCustom48h12": 4 / 6,
    "DICT_4X4_50": 2 / 6,
    "DICT_6X6_250": 2 / 8,
    "DICT_ARUCO_ORIGINAL": 2 / 7,
}
# That the SVG draws the shapes of the PDF, number by number, a test of the program says; one of each shape is read here.
SVG_KINDS = ("tag36h11", "chessboard", "dots")


def resight(*words):
    run = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, check=False)
    assert run.returncode in (0, 1), (words, run.stderr)
    return run.stdout


def designed(kind, keys):
    """Where each feature lies on its target, mm, y down, about any origin: computed here from the keys alone."""
    if kind == "aprilgrid":
        rows, columns, size, gap = 4, 3, 40.0, 12.0
        for i in range(rows * columns):
            x, y = (i % columns) * (size + gap), -(i // columns) * (size + gap)
            for corner, (dx, dy) in enumerate([(0, -size), (size, -size), (size, 0), (0, 0)]):
                yield (i, corner), (x + dx, y + dy)
    elif kind == "chessboard":
        for i in range(54):
            yield (i, 0), (25.0 * (i % 9), 25.0 * (i // 9))
    elif kind == "charuco":
        for i in range(24):
            yield (i, 0), (30.0 * (i % 4), 30.0 * (i // 4))
    elif kind == "dots":
        yield from (((i, 0), p) for i, p in enumerate([(0, 0), (100, 0), (150, 0), (0, 150)]))
    else:
        words = keys.split()
        size = 1000 * float(words[words.index("--size-m") + 1])
        ids = words[words.index("--id") + 1].split("-")
        pitch = size * (1 + RIMS[kind] + 0.15) if kind in RIMS else 0.0
        for n, i in enumerate(range(int(ids[0]), int(ids[-1]) + 1)):
            x, y = (n % 4) * pitch, (n // 4) * pitch
            for corner, (dx, dy) in enumerate([(-1, -1), (1, -1), (1, 1), (-1, 1)]):
                yield (i, corner), (x + dx * size / 2, y + dy * size / 2)


def rasterised(path, dpi):
    """Grey image of the first page, and its pixels per millimetre along x and y: both programs round a page to whole pixels."""
    if path.suffix == ".svg":
        head = path.read_text().split(">")[0]
        size_mm = [float(head.split(f'{side}="')[1].split("mm")[0]) for side in ("width", "height")]
        # resvg cuts pixels in quarters: rasterised four times finer, and averaged.
        png = resvg_py.svg_to_bytes(svg_path=str(path), dpi=4 * dpi, background="white")
        fine = np.array(Image.open(io.BytesIO(bytes(png))).convert("L"), float)
        rows, columns = fine.shape[0] // 4, fine.shape[1] // 4
        image = fine[: 4 * rows, : 4 * columns].reshape(rows, 4, columns, 4).mean(axis=(1, 3)).round().astype(np.uint8)
        return image, [dpi / 25.4] * 2, size_mm
    else:
        page = pypdfium2.PdfDocument(path)[0]
        size_mm = [side * 25.4 / 72 for side in page.get_size()]
        image = np.array(page.render(scale=dpi / 72, grayscale=True).to_pil().convert("L"))
    return image, [image.shape[1] / size_mm[0], image.shape[0] / size_mm[1]], size_mm


def errors(found, wanted, per_mm):
    """Relative errors of the scale, and the bias against the place on the page in px, by axis; none of it depends on where the sheet is."""
    keys = sorted(wanted)
    assert sorted(found) == keys, f"{len(found)} of {len(keys)} corners: not {sorted(set(keys) - set(found))[:5]}"
    p = np.array([wanted[k] for k in keys], float) * per_mm
    q = np.array([found[k] for k in keys], float)
    pc, qc = p - p.mean(axis=0), q - q.mean(axis=0)
    return (pc * qc).sum(axis=0) / (pc * pc).sum(axis=0) - 1, q.mean(axis=0) - p.mean(axis=0), np.sqrt(np.mean((qc - pc) ** 2))


def opencv(kind, image):
    """What OpenCV finds, by (id, corner) as Resight counts them; none where it has no detector."""
    aruco = cv2.aruco
    parameters = aruco.DetectorParameters()
    parameters.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
    if kind == "chessboard":
        _, corners = cv2.findChessboardCornersSB(image, (9, 6), flags=cv2.CALIB_CB_ACCURACY)
        corners = corners.reshape(-1, 2)
        if corners[0].sum() > corners[-1].sum():
            corners = corners[::-1]
        return {(i, 0): p for i, p in enumerate(corners)}
    if kind == "charuco":
        dictionary = aruco.getPredefinedDictionary(aruco.DICT_5X5_100)
        board = aruco.CharucoBoard((5, 7), 0.03, 0.022, dictionary)
        corners, ids, _, _ = aruco.CharucoDetector(board).detectBoard(image)
        return {(int(i), 0): p for i, p in zip(ids.ravel(), corners.reshape(-1, 2))}
    names = {"tag": "DICT_APRILTAG_36h11", "tag36h11": "DICT_APRILTAG_36h11", "tag25h9": "DICT_APRILTAG_25h9", "tag16h5": "DICT_APRILTAG_16h5"}
    name = names.get(kind, kind)
    if not name.startswith("DICT_"):
        return None
    dictionary = aruco.getPredefinedDictionary(getattr(aruco, name))
    corners, ids, _ = aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    # OpenCV's copies of AprilTag families are turned by half.
    half = 2 if name.startswith("DICT_APRILTAG") else 0
    assert ids is not None, "no marker"
    return {(int(i), c): quad[0][(c + half) % 4] for i, quad in zip(ids.ravel(), corners) for c in range(4)}


def origin(svg):
    """Where the first feature's target begins on the page: the box of the ink, which the page states."""
    numbers = lambda text: [float(x) for x in text.replace("M", " ").replace("L", " ").replace("Z", " ").split()]
    points = [numbers(d.split('"')[0]) for d in svg.split(' d="')[1:]]
    xs = [x for p in points for x in p[0::2]]
    ys = [y for p in points for y in p[1::2]]
    for part in svg.split("<circle ")[1:]:
        x, y, r = (float(part.split(f'{key}="')[1].split('"')[0]) for key in ("cx", "cy", "r"))
        xs += [x - r, x + r]
        ys += [y - r, y + r]
    return [min(xs), min(ys), max(xs), max(ys)]


def placed(kind, keys, box):
    """Features in millimetres of the page, from the box of the ink."""
    wanted = dict(designed(kind, keys))
    values = np.array(list(wanted.values()), float)
    low, high = values.min(axis=0), values.max(axis=0)
    # Corners and dots lie symmetrically in the ink but for a data ring, which is symmetric too only where it is wholly black: use the centre.
    centre = np.array([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2])
    return {k: np.array(v, float) - (low + high) / 2 + centre for k, v in wanted.items()}


def main():
    assert PROGRAM, "build the program first: cargo build --release -p resight-cli"
    save = pathlib.Path(sys.argv[sys.argv.index("--save") + 1]) if "--save" in sys.argv else None
    worst = {}
    failed = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        for kind, keys in KINDS.items():
            for ending in ("pdf", "svg"):
                answer = json.loads(resight("print", *keys.split(), "-o", folder / f"{kind}.{ending}", "--json"))
                assert answer["n_pages"] == 1, answer
            assert b"/PrintScaling /None" in (folder / f"{kind}.pdf").read_bytes()
            wanted = placed(kind, keys, origin((folder / f"{kind}.svg").read_text()))
            for ending, resolutions in (("pdf", (150, 300)), ("svg", (150,) if kind in SVG_KINDS else ())):
                for dpi in resolutions:
                    image, per_mm, size_mm = rasterised(folder / f"{kind}.{ending}", dpi)
                    assert np.allclose(size_mm, answer["page_size_mm"], atol=1e-4), (size_mm, answer["page_size_mm"])
                    png = folder / f"{kind}-{ending}-{dpi}.png"
                    is_tags = kind in FAMILIES or kind == "tag"
                    cv2.imwrite(str(png), image)
                    if save and dpi == 150:
                        save.mkdir(parents=True, exist_ok=True)
                        cv2.imwrite(str(save / png.name), image)
                    rows = json.loads(resight("detect", png, "--target", folder / f"{kind}.toml", "--json"))["detections"]
                    readers = {"Resight": {(r["id"], r["corner"]): (r["u_px"], r["v_px"]) for r in rows}, "OpenCV": opencv(kind, image)}
                    for reader, found in readers.items():
                        if found is None:
                            continue
                        found = {k: np.array(v) + 0.5 for k, v in found.items()}  # pixel centres to edges: page (0, 0) is a corner
                        try:
                            scale, bias, rms = errors(found, wanted, per_mm)
                        except AssertionError as reason:
                            failed.append(f"{reader}, {kind}.{ending}, {dpi} dpi: {reason}")
                            continue
                        name = f"{reader}, {'tags' if is_tags else 'boards and dots'}"
                        before = worst.get(name, (0.0, 0.0))
                        worst[name] = max(before[0], abs(scale).max()), max(before[1], abs(bias).max())
                        line = f"{reader}, {kind}.{ending}, {dpi} dpi: {len(found)} corners, scale {scale[0]:+.1e} {scale[1]:+.1e}, bias {bias[0]:+.3f} {bias[1]:+.3f} px, rms {rms:.3f} px"
                        is_bound = reader == "OpenCV" and is_tags
                        most_scale, most_bias = OPENCV_TAGS[kind in FAMILIES] if is_bound else (SCALE, BIAS_PX)
                        is_good = abs(scale).max() < most_scale and abs(bias).max() < most_bias
                        if "-v" in sys.argv or not is_good:
                            print(("" if is_good else "FAILS  ") + line)
                        if not is_good:
                            failed.append(line)
    for reader, (scale, bias) in worst.items():
        print(f"{reader}, from PDF and SVG at 150 and 300 dpi: every corner, scale within {100 * scale:.4f} %, bias within {bias:.3f} px")
    for line in failed:
        print(line)
    sys.exit(bool(failed))


main()
