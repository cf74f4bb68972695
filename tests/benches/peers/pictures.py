"""Pictures of meshes, with their edges: a plain z-buffer in numpy.

    python pictures.py --work FOLDER --lacuna ADAPTER [--results FOLDER]
"""
import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from compare import command, run
from inputs import shape
from judge import HERE, read_mesh

PIXELS = 900


def camera(direction, up=(0, 0, 1)):
    """Right, up and towards the eye."""
    back = np.array(direction, float) / np.linalg.norm(direction)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def render(vertices, triangles, direction, centre, half, edges=True, pixels=PIXELS):
    """An orthographic view of the square of half width `half` around `centre`: flat shading, edges drawn a pixel wide."""
    axes = camera(direction)
    seen = (vertices - centre) @ axes.T
    screen = (seen[:, :2] / half + 1) / 2 * pixels
    screen[:, 1] = pixels - screen[:, 1]
    corner = screen[triangles]
    low, high = np.floor(corner.min(axis=1)).astype(int), np.ceil(corner.max(axis=1)).astype(int)
    space = vertices[triangles]
    normal = np.cross(space[:, 1] - space[:, 0], space[:, 2] - space[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    facing = normal @ axes[2]
    light = np.array([0.35, 0.5, 0.8]) @ axes
    shade = 0.25 + 0.75 * np.clip(normal @ light / np.linalg.norm(light), 0, 1)
    depth, colour = np.full((pixels, pixels), -np.inf), np.ones((pixels, pixels, 3))
    visible = (facing > 0) & (high >= 0).all(axis=1) & (low < pixels).all(axis=1)
    for t in np.flatnonzero(visible):
        x0, y0 = np.maximum(low[t], 0)
        x1, y1 = np.minimum(high[t] + 1, pixels)
        if x0 >= x1 or y0 >= y1:
            continue
        x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
        a, b, c = corner[t]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0:
            continue
        weights = [((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])) / area for p, q in ((b, c), (c, a), (a, b))]
        inside = (weights[0] >= 0) & (weights[1] >= 0) & (weights[2] >= 0)
        z = sum(w * seen[v, 2] for w, v in zip(weights, triangles[t]))
        window = depth[y0:y1, x0:x1]
        inside &= z > window
        if not inside.any():
            continue
        window[inside] = z[inside]
        paint = shade[t] * np.array([0.95, 0.8, 0.55])
        colour[y0:y1, x0:x1][inside] = paint
        if edges:
            sides = [np.linalg.norm(q - p) for p, q in ((b, c), (c, a), (a, b))]
            rim = np.min([w * abs(area) / max(s, 1e-9) for w, s in zip(weights, sides)], axis=0)
            colour[y0:y1, x0:x1][inside & (rim < 0.8)] = 0.45 * paint
    return colour


def close(name, options, tolerance_divisor=10, program="lacuna", setting=1):
    """The mesh of one run."""
    made, out = shape(name), options.work / "picture.bin"
    done = run(command(program, made, options.work, options.lacuna, made.radius / tolerance_divisor, setting, out), out, 150)
    if "failed" in done:
        raise SystemExit(f"{name}, {program}: {done['failed']}")
    return made, *read_mesh(out)


# Name of the picture: shape, program, its setting, direction of view, centre in parts of the box, half width in radii.
VIEWS = {
    "koch5": ("koch5", "lacuna", 1, (0.25, -0.35, 1), (0.5, 0.86, 0.5), 9),
    "koch5-openvdb": ("koch5", "openvdb", 1, (0.25, -0.35, 1), (0.5, 0.86, 0.5), 9),
    "sierp7": ("sierp7", "lacuna", 1, (0.2, -0.5, 1), (0.25, 0.1, 0.5), 12),
    "hilbert4": ("hilbert4", "lacuna", 1, (1, -1.4, 0.9), (1, 0, 1), 9),
    "tree20k": ("tree20k", "lacuna", 1, (1, -1.2, 0.4), (0.6, 0.2, 0.75), 10),
    "takagi128": ("takagi128", "lacuna", 1, (0.6, -0.8, 1.2), (0.5, 0.5, 0.8), 14),
    "tetra6": ("tetra6", "lacuna", 1, (0.6, -1, 0.5), (0.5, 0.2, 0.4), 10),
    "menger3": ("menger3", "lacuna", 1, (1, -1.3, 0.9), (1, 0, 1), 14),
}


def main():
    """Each view as PNG."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--work", type=Path, required=True)
    words.add_argument("--lacuna", type=Path, required=True)
    words.add_argument("--results", type=Path, default=HERE / "results")
    words.add_argument("--views", default=",".join(VIEWS))
    options = words.parse_args()
    for view in options.views.split(","):
        name, program, setting, direction, place, half = VIEWS[view]
        made, vertices, triangles = close(name, options, 10, program, setting)
        low, high = made.vertices.min(axis=0), made.vertices.max(axis=0)
        centre = low + np.array(place) * (high - low)
        picture = render(vertices, triangles, direction, centre, half * made.radius)
        plt.imsave(options.results / f"{view}.png", np.clip(picture, 0, 1))
        print(view, len(triangles), flush=True)


if __name__ == "__main__":
    main()
