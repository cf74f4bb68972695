"""Measures the true error and the topology of a mesh that is meant to be a dilation, without trusting whoever made it.

Band. With d the distance from the input, the least and the greatest d on the whole mesh (corners, edges and interiors) are
found in judge.cpp: the least from exact distances between triangles, the greatest by subdivision, to a thousandth of the
tolerance. The error is e = max(r - least, greatest - r).
Solid. The mesh lies where r - e <= d <= r + e, so how often it winds around a point is constant on every piece of
{d < r - e} and of {d > r + e}. It is computed at every site (each piece of the first holds one) and at random points just
beyond both surfaces, voids of the dilation included. Together: {d < r - e} is inside, {d > r + e} is outside.
A mesh of more than MEASURED triangles has its error measured on a random part of them only: a lower bound, in its favour.
Topology. Edges, fans of triangles around vertices, Euler number, shells, genus, and every pair of triangles that cross.
"""
import ctypes
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

HERE = Path(__file__).resolve().parent
SAMPLES = 20000
MEASURED = 3_000_000
COUNTED = 16_000_000


def compiled(folder):
    """The functions of judge.cpp, built if its source is newer."""
    library, source = Path(folder) / "judge.so", HERE / "judge.cpp"
    if not library.exists() or library.stat().st_mtime < source.stat().st_mtime:
        options = "-O2 -march=native -ffp-contract=off -fopenmp -shared -fPIC -Wall".split()
        subprocess.run(["g++", *options, "-o", str(library), str(source)], check=True)
    functions = ctypes.CDLL(str(library.resolve()))
    pointer, count, real = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
    functions.hierarchy_new.restype, functions.hierarchy_new.argtypes = pointer, [pointer, pointer, count, ctypes.c_int]
    functions.hierarchy_free.argtypes = [pointer]
    functions.distances.argtypes = [pointer, pointer, count, pointer]
    functions.extremes.argtypes = [pointer, pointer, pointer, count, real, real, pointer]
    functions.windings.argtypes = [pointer, pointer, count, pointer, pointer]
    functions.crossings.restype = count
    functions.crossings.argtypes = [pointer, pointer, pointer, count, pointer, count]
    return functions


class Hierarchy:
    """Simplices to measure from."""

    def __init__(self, functions, vertices, cells):
        self.functions = functions
        self.vertices, self.cells = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(cells, np.int32)
        self.handle = functions.hierarchy_new(self.vertices.ctypes.data, self.cells.ctypes.data, len(self.cells), self.cells.shape[1])

    def __del__(self):
        self.functions.hierarchy_free(self.handle)

    def distances(self, points):
        """From each point to the nearest simplex."""
        points = np.ascontiguousarray(points, np.float64)
        out = np.empty(len(points))
        self.functions.distances(self.handle, points.ctypes.data, len(points), out.ctypes.data)
        return out

    def extremes(self, mesh, piece, accuracy):
        """The least and the greatest distance of a mesh from the simplices, and where."""
        out = np.empty(8)
        self.functions.extremes(self.handle, mesh.vertices.ctypes.data, mesh.cells.ctypes.data, len(mesh.cells), piece, accuracy, out.ctypes.data)
        return out[0], out[1:4], out[4], out[5:]

    def windings(self, points):
        """How often the triangles wind around each point; two rays must agree, or a third decides."""
        points = np.ascontiguousarray(points, np.float64)
        rays = []
        for direction in ([0.83172, 0.31447, 0.45761], [-0.26119, 0.71923, -0.64381], [0.4407, -0.5923, 0.6744]):
            ray, out = np.array(direction), np.empty(len(points), np.int32)
            self.functions.windings(self.handle, points.ctypes.data, len(points), ray.ctypes.data, out.ctypes.data)
            rays.append(out)
        return np.median(rays, axis=0).astype(int)

    def crossings(self, room=16):
        """The number of pairs of triangles that cross, and some of them."""
        pairs = np.empty((room, 2), np.int64)
        found = self.functions.crossings(self.handle, self.vertices.ctypes.data, self.cells.ctypes.data, len(self.cells), pairs.ctypes.data, room)
        return found, pairs[: min(found, room)]


def read_mesh(path):
    """u64 vertices, u64 triangles, f64 coordinates, u32 corners; little endian."""
    with open(path, "rb") as file:
        vertices, triangles = np.fromfile(file, np.uint64, 2).tolist()
        return np.fromfile(file, np.float64, 3 * vertices).reshape(-1, 3), np.fromfile(file, np.uint32, 3 * triangles).reshape(-1, 3).astype(np.int32)


def write_mesh(path, vertices, triangles):
    """The same."""
    with open(path, "wb") as file:
        np.array([len(vertices), len(triangles)], np.uint64).tofile(file)
        np.ascontiguousarray(vertices, np.float64).tofile(file)
        np.ascontiguousarray(triangles, np.uint32).tofile(file)


def pieces(links, count):
    """The component of each of `count` nodes."""
    return connected_components(coo_matrix((np.ones(len(links), bool), links.T), shape=(count, count)), directed=False)


def topology(vertices, triangles):
    """Whether the mesh is the boundary of a solid, and its counts."""
    faces = triangles.astype(np.int64)
    if len(faces) == 0:
        return {"manifold": False, "empty": True}
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    key, reverse = half[:, 0] * len(vertices) + half[:, 1], half[:, 1] * len(vertices) + half[:, 0]
    order = np.argsort(key, kind="stable")
    place = np.searchsorted(key[order], reverse)
    matched = key[order][np.minimum(place, len(key) - 1)] == reverse
    open_edges = int((~matched).sum())
    repeated = int((np.diff(key[order]) == 0).sum())
    degenerate = int((half[:, 0] == half[:, 1]).sum())
    used = np.unique(faces)
    counts = {"open_edges": open_edges, "repeated_edges": repeated, "degenerate_triangles": degenerate}
    if open_edges or repeated or degenerate:
        return {"manifold": False, **counts}
    # A half edge e of corner e: the fan around its first vertex goes on at the half edge after its twin.
    n = len(faces)
    twin = order[place]
    after = np.where(twin < 2 * n, twin + n, twin - 2 * n)
    fans, _ = pieces(np.column_stack([np.arange(3 * n), after]), 3 * n)
    shells, shell = pieces(half, len(vertices))
    shells -= len(vertices) - len(used)
    _, first, face_shell = np.unique(shell[faces[:, 0]], return_index=True, return_inverse=True)
    # Seen from one of its own corners: of a void that is small beside how far it is from the origin, rounding would take the sign.
    corner = vertices[faces].astype(float) - vertices[faces[first, 0]].astype(float)[face_shell][:, None]
    volumes = np.zeros(shells)
    np.add.at(volumes, face_shell, np.einsum("ij,ij->i", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6)
    euler = len(used) - len(half) // 2 + n
    pinched = int(fans - len(used))
    return {
        "manifold": pinched == 0, **counts, "pinched_vertices": pinched, "euler": int(euler), "shells": int(shells),
        "cavities": int((volumes < 0).sum()), "genus": int(shells - euler // 2), "volume": float(volumes.sum()),
    }


def probes(shape, sites, radius, error, count, seed=7):
    """Points nearer than r - e and points farther than r + e, close to both surfaces: random places of the input pushed away."""
    random = np.random.default_rng(seed)
    weights = random.dirichlet(np.ones(shape.cells.shape[1]), count)
    origin = np.einsum("ij,ijk->ik", weights, shape.vertices[shape.cells[random.integers(0, len(shape.cells), count)]])
    away = random.normal(size=(count, 3))
    away /= np.linalg.norm(away, axis=1)[:, None]
    near, far = (origin + factor * away for factor in (radius - 1.001 * error, radius + 1.1 * error))
    deep = origin + (radius * random.uniform(0, 3, count))[:, None] * away
    points = np.concatenate([near, far, deep, shape.vertices, shape.vertices[shape.cells].mean(axis=1)])
    distance = sites.distances(points)
    return points[distance < radius - error], points[distance > radius + error]


def judge(functions, shape, radius, tolerance, vertices, triangles):
    """Everything that is measured of one mesh."""
    found = {"triangles": len(triangles)}
    if len(triangles) == 0:
        return {**found, "error": float("inf"), "error_over_tolerance": float("inf"), "solid": False}
    if len(triangles) <= COUNTED:
        found |= topology(vertices, triangles)
    sites = Hierarchy(functions, shape.vertices, shape.cells)
    if len(triangles) > MEASURED:
        some = np.random.default_rng(7).choice(len(triangles), MEASURED // 4, replace=False)
        least, _, greatest, _ = sites.extremes(Hierarchy(functions, vertices, triangles[some]), radius / 2, tolerance / 1000)
        error = float(max(radius - least, greatest - radius))
        return found | {"sampled_triangles": len(some), "error": error, "error_over_tolerance": error / tolerance}
    mesh = Hierarchy(functions, vertices, triangles)
    least, _, greatest, _ = sites.extremes(mesh, radius / 2, tolerance / 1000)
    error = max(radius - least, greatest - radius)
    inner, outer = probes(shape, sites, radius, max(error, tolerance / 100), SAMPLES)
    wrong = [int((mesh.windings(inner) != 1).sum()), int((mesh.windings(outer) != 0).sum())]
    found |= {
        "inner": float(radius - least), "outer": float(greatest - radius), "error": float(error),
        "error_over_tolerance": float(error / tolerance), "solid": wrong == [0, 0],
        "probes": [len(inner), len(outer)], "wrong_probes": wrong,
    }
    found["crossings"] = int(mesh.crossings()[0])
    return found


def main():
    """python judge.py SHAPE MESH.bin TOLERANCE_DIVISOR FOLDER: one verdict."""
    import json

    from inputs import shape

    made = shape(sys.argv[1])
    verdict = judge(compiled(sys.argv[4]), made, made.radius, made.radius / float(sys.argv[3]), *read_mesh(sys.argv[2]))
    print(json.dumps(verdict))


if __name__ == "__main__":
    main()
