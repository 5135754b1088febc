"""Curves of the sweep of detect.py as SVG pictures: recall and error over size, tilt and blur, Resight (solid) and OpenCV (dashed)."""

AXES = {
    "size": ("tag edge, square or four dots' diameter, px", {"size 16": 16, "size 24": 24, "size 32": 32, "easy": 48, "size 80": 80}),
    "tilt": ("tilt, °", {"tilt 0": 0, "easy": 25, "tilt 45": 45, "tilt 60": 60, "tilt 70": 70, "tilt 75": 75}),
    "blur": ("blur (standard deviation), px", {"blur 0": 0, "easy": 0.7, "blur 2": 2, "blur 3": 3}),
}
COLOURS = {"tag": "#4269d0", "aprilgrid": "#efb118", "charuco": "#ff725c", "chessboard": "#3ca951", "dots": "#7a5195"}
QUANTITIES = {"recall": ("recall, %", 0, 100.0), "error": ("error (rms of an axis), px", 1, 0.3)}
WIDTH, HEIGHT, LEFT, TOP, GAP = 240, 170, 52, 40, 62


def polyline(points, colour, dash):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.2" fill="{colour}"/>' for x, y in points)
    style = ' stroke-dasharray="5 4"' if dash else ""
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"{style}/>{dots}'


def panel(cells, axis, quantity, left):
    """One pair of axes; `cells` maps (target, contender, condition) to (recall %, rms px)."""
    title, places = AXES[axis]
    index, most = QUANTITIES[quantity][1:]
    low, high = min(places.values()), max(places.values())
    x_of = lambda x: left + WIDTH * (x - low) / (high - low)
    y_of = lambda y: TOP + HEIGHT * (1 - min(y, most) / most)
    out = [f'<rect x="{left}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#999"/>']
    for x in places.values():
        out.append(f'<text x="{x_of(x):.1f}" y="{TOP + HEIGHT + 14}" text-anchor="middle">{x:g}</text>')
    for share in (0, 0.5, 1):
        y = y_of(share * most)
        out.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{share * most:g}</text>')
        out.append(f'<line x1="{left}" x2="{left + WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>')
    out.append(f'<text x="{left + WIDTH / 2}" y="{TOP + HEIGHT + 30}" text-anchor="middle">{title}</text>')
    for target, colour in COLOURS.items():
        for name in ("OpenCV", "Resight"):
            known = [(x, cells.get((target, name, condition))) for condition, x in places.items()]
            points = [(x_of(x), y_of(c[index])) for x, c in known if c is not None and c[index] == c[index]]
            if points:
                out.append(polyline(points, colour, name == "OpenCV"))
    return "\n".join(out)


def write(cells, folder):
    for quantity, (title, *_) in QUANTITIES.items():
        width = LEFT + 3 * WIDTH + 2 * GAP + 20
        parts = [f'<text x="{LEFT}" y="16" font-weight="bold">{title}</text>']
        for k, (target, colour) in enumerate(COLOURS.items()):
            x = LEFT + 190 + 100 * k
            parts.append(f'<line x1="{x}" x2="{x + 18}" y1="12" y2="12" stroke="{colour}" stroke-width="3"/>')
            parts.append(f'<text x="{x + 23}" y="16">{target}</text>')
        parts.append(f'<text x="{LEFT + 190}" y="32" fill="#666">solid: Resight, dashed: OpenCV</text>')
        parts += [panel(cells, axis, quantity, LEFT + k * (WIDTH + GAP)) for k, axis in enumerate(AXES)]
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{TOP + HEIGHT + 42}" font-family="sans-serif" font-size="11">'
        ground = '<rect width="100%" height="100%" fill="white"/>'
        with open(f"{folder}/targets-{quantity}.svg", "w") as file:
            file.write("\n".join([head, ground, *parts, "</svg>", ""]))
