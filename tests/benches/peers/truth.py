"""The true topology of each dilation, from an alpha complex: independent of every mesh, lattice and marching rule.

    python truth.py FOLDER [NAME...]        writes FOLDER/truth.json

The union of balls of radius a around a finite set S is homotopy equivalent to the alpha complex of S at a^2 (Edelsbrunner 1995);
gudhi computes it with exact predicates. S samples the input so that every point of a cell has a sample of its own cell, edge or
vertex within c: then a point x at distance d from the input, whose nearest point lies inside a cell, edge or vertex and x - nearest
is square to it, has a sample at distance at most sqrt(d^2 + c^2) (Pythagoras). With I for the input, and a <= b:

    D(I, sqrt(a^2 - c^2))  is in  D(S, a)  is in  D(I, a).

So the critical radii of I and S are interleaved, up to a part of c^2 / 2 r^2. The Betti numbers of D(S, a) are computed at
a = r and at sqrt(r^2 + c^2); c is halved until both agree, and what they say is called the truth at r. Points need no samples: there
the numbers are exact. Betti numbers at r +- r/40 and r +- r/10 tell which tolerance still determines the topology: where they
differ, a mesh within the tolerance may rightly have another one.
"""
import json
import sys
from pathlib import Path

import gudhi
import numpy as np

from inputs import SHAPES, shape

# c in parts of r, coarsest first, as long as the number of samples is bearable.
FINENESS = (0.2, 0.1, 0.05, 0.025)
MOST_SAMPLES = 1_500_000


def along(vertices, edges, spacing):
    """Points on segments, ends left out, at most `spacing` apart."""
    start, way = vertices[edges[:, 0]], vertices[edges[:, 1]] - vertices[edges[:, 0]]
    parts = np.maximum(1, np.ceil(np.linalg.norm(way, axis=1) / spacing)).astype(int)
    owner = np.repeat(np.arange(len(edges)), parts - 1)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
    return start[owner] + (step / parts[owner])[:, None] * way[owner]


def within(corners, cover):
    """Points in triangles: the barycentric lattice of n parts, whose small triangles have radius of cover (the radius of the
    least enclosing circle) at most `cover`."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    sides = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2), axis=1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    acute = sides[:, 0] ** 2 + sides[:, 1] ** 2 > sides[:, 2] ** 2
    enclosing = np.where(acute, sides.prod(axis=1) / np.maximum(4 * area, 1e-300), sides[:, 2] / 2)
    parts = np.maximum(1, np.ceil(enclosing / cover)).astype(int)
    points = []
    for n in np.unique(parts[parts > 1]):
        i, j = (x.ravel() for x in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
        i, j = i[i + j <= n] / n, j[i + j <= n] / n
        of = parts == n
        points.append((a[of][:, None] + i[:, None] * (b - a)[of][:, None] + j[:, None] * (c - a)[of][:, None]).reshape(-1, 3))
    return np.concatenate(points) if points else np.empty((0, 3))


def samples(made, cover):
    """Vertices, edges and interiors, each sampled on its own."""
    vertices, cells = made.vertices, made.cells
    parts = [vertices[np.unique(cells)]]
    if cells.shape[1] == 2:
        parts.append(along(vertices, cells, 2 * cover))
    if cells.shape[1] == 3:
        edges = np.unique(np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]), axis=1), axis=0)
        parts += [along(vertices, edges, 2 * cover), within(vertices[cells], cover)]
    points = np.concatenate(parts)
    # One sample where cells that are not welded repeat it.
    _, first = np.unique(np.round(points / (1e-9 * made.diagonal)).astype(np.int64), axis=0, return_index=True)
    points = points[np.sort(first)]
    flat = np.ptp(points, axis=0) == 0
    return points[:, ~flat]  # balls with centres in a plane and their discs have the same nerve


def betti(tree, square):
    """Betti numbers of the complex at a squared radius, over Z/2 (no torsion in a subset of space)."""
    tree.prune_above_filtration(square)
    tree.compute_persistence(homology_coeff_field=2, min_persistence=-1, persistence_dim_max=True)
    numbers = tree.persistent_betti_numbers(square, square)
    return (numbers + [0, 0, 0])[:3]


def truth(name):
    """Betti numbers at the radii of the sandwich."""
    made = shape(name)
    r = made.radius
    found = None
    for fineness in FINENESS if made.cells.shape[1] > 1 else (0.0,):
        points = samples(made, fineness * r)
        if found and len(points) > MOST_SAMPLES:
            break
        tree = gudhi.AlphaComplex(points=points, precision="safe").create_simplex_tree()
        upper = r * np.sqrt(1 + fineness**2)
        radii = {"r + r/10": upper + r / 10, "r + r/40": upper + r / 40, "r, upper": upper, "r": r, "r - r/40": r - r / 40, "r - r/10": r - r / 10}
        betti_numbers = {label: betti(tree, radius * radius) for label, radius in radii.items()}
        found = {"samples": len(points), "cover_over_radius": fineness, "betti": betti_numbers}
        if betti_numbers["r"] == betti_numbers["r, upper"]:
            break
    pieces, handles, cavities = betti_numbers["r"]
    stable = lambda *labels: all(betti_numbers[label] == betti_numbers["r"] for label in labels)
    return found | {
        "settled": stable("r, upper"), "stable_r/40": stable("r, upper", "r + r/40", "r - r/40"), "stable_r/10": stable(*betti_numbers),
        "pieces": pieces, "genus": handles, "cavities": cavities, "shells": pieces + cavities, "euler": 2 * (pieces - handles + cavities),
    }


def main():
    """One entry a shape."""
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    path = Path(sys.argv[1]) / "truth.json"
    known = json.loads(path.read_text()) if path.exists() else {}
    for name in sys.argv[2:] or SHAPES:
        known[name] = truth(name)
        path.write_text(json.dumps(known, indent=1) + "\n")
        print(name, json.dumps(known[name]), flush=True)


if __name__ == "__main__":
    main()
