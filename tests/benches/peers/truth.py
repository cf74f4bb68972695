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
from array import array
from pathlib import Path

import gudhi
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from inputs import SHAPES, shape

# c in parts of r, coarsest first, as long as the number of samples is bearable.
FINENESS = (0.3, 0.2, 0.1, 0.05, 0.025)
MOST_SAMPLES = 350_000


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


class Filtration:
    """The simplices of an alpha complex, a dimension at a time, with the squared radius at which each appears."""

    def __init__(self, points):
        tree = gudhi.AlphaComplex(points=points, precision="safe").create_simplex_tree()
        self.dimension = points.shape[1]
        corners, values = [array("i") for _ in range(self.dimension + 1)], [array("d") for _ in range(self.dimension + 1)]
        for simplex, value in tree.get_simplices():
            corners[len(simplex) - 1].extend(simplex)
            values[len(simplex) - 1].append(value)
        self.corners = [np.sort(np.frombuffer(c, np.int32).reshape(-1, k + 1), axis=1) for k, c in enumerate(corners)]
        self.values = [np.frombuffer(v) for v in values]
        if self.dimension == 3:
            self.sides = self.sides_of_tetrahedra()

    def sides_of_tetrahedra(self):
        """For each triangle the two tetrahedra beside it; the space outside the hull is one more."""
        count = len(self.corners[0])
        key = lambda c: (c[:, 0].astype(np.int64) * count + c[:, 1]) * count + c[:, 2]  # below 2^63 for 2 million points
        tetrahedra, keys = self.corners[3], key(self.corners[2])
        order = np.argsort(keys)
        faces = np.concatenate([key(np.delete(tetrahedra, k, axis=1)) for k in range(4)])
        triangle = order[np.searchsorted(keys[order], faces)]
        owner = np.tile(np.arange(len(tetrahedra)), 4)
        by_triangle = np.argsort(triangle, kind="stable")
        start = np.searchsorted(triangle[by_triangle], np.arange(len(keys)))
        end = np.searchsorted(triangle[by_triangle], np.arange(len(keys)), side="right")
        first = owner[by_triangle[start]]
        second = np.where(end - start == 2, owner[by_triangle[end - 1]], len(tetrahedra))
        return np.column_stack([first, second])

    def betti(self, square):
        """Pieces, handles and cavities of the complex at a squared radius: pieces and, by Alexander duality, cavities are counted
        as components of the complex and of its complement; handles follow from the Euler number."""
        euler = sum((-1) ** k * int((values <= square).sum()) for k, values in enumerate(self.values))
        pieces = components(self.corners[1][self.values[1] <= square], len(self.corners[0]))
        cavities = 0
        if self.dimension == 3:
            outside = len(self.corners[3])
            links = self.sides[self.values[2] > square]
            inside = int((self.values[3] <= square).sum())
            cavities = components(links, outside + 1) - inside - 1
        return [pieces, pieces + cavities - euler, cavities]


def components(links, count):
    """Of a graph."""
    ones = np.ones(len(links), bool)
    return int(connected_components(coo_matrix((ones, (links[:, 0], links[:, 1])), shape=(count, count)), directed=False)[0])


def truth(name):
    """Betti numbers at the radii of the sandwich."""
    made = shape(name)
    r = made.radius
    found = None
    for fineness in FINENESS if made.cells.shape[1] > 1 else (0.0,):
        points = samples(made, fineness * r)
        if found and len(points) > MOST_SAMPLES:
            break
        filtration = Filtration(points)
        upper = lambda radius: np.hypot(radius, fineness * r)
        radii = {"r + r/10": upper(1.1 * r), "r + r/40": upper(1.025 * r), "r, upper": upper(r), "r": r, "r - r/40": 0.975 * r, "r - r/10": 0.9 * r}
        betti_numbers = {label: filtration.betti(radius * radius) for label, radius in radii.items()}
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
