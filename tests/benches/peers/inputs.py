"""The shapes that are thickened: wires, surfaces and points, each from its formula.

    python inputs.py FOLDER [NAME...]      writes NAME.obj with 17 significant digits

A shape is an array of vertices and one of cells: points, segments or triangles by the number of columns. Random numbers come
from SplitMix64 (Steele, Lea, Flood 2014), so that every machine makes the same shapes.
"""
import sys
from dataclasses import dataclass
from itertools import permutations, product
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Shape:
    """Vertices and the cells that are thickened."""

    name: str
    vertices: np.ndarray
    cells: np.ndarray

    @property
    def diagonal(self):
        """Of the bounding box."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @property
    def radius(self):
        """The radius that the comparison uses: a hundredth of the diagonal."""
        return 0.01 * self.diagonal

    def write(self, path):
        """As Wavefront OBJ: `l` for points (lines of one vertex) and segments, `f` for triangles."""
        word = "f" if self.cells.shape[1] == 3 else "l"
        with open(path, "w") as out:
            out.writelines("v %.17g %.17g %.17g\n" % tuple(v) for v in self.vertices)
            out.writelines(f"{word} {' '.join(map(str, c))}\n" for c in (self.cells + 1).tolist())


def uniform(seed):
    """Endless numbers in [0, 1) from SplitMix64."""
    mask, state = 2**64 - 1, seed
    while True:
        state = (state + 0x9E3779B97F4A7C15) & mask
        z = state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        yield ((z ^ (z >> 31)) >> 11) * 2.0**-53


def weld(points, cells):
    """One vertex for points that are equal to 1e-9; cells that lose a corner go."""
    _, first, inverse = np.unique(np.round(points * 1e9).astype(np.int64), axis=0, return_index=True, return_inverse=True)
    cells = inverse.reshape(-1)[cells]
    corners = np.sort(cells, axis=1)
    return points[first], cells[(np.diff(corners, axis=1) != 0).all(axis=1)]


def polyline(points):
    """Segments between successive points."""
    points = np.asarray(points, float)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    steps = np.arange(len(points) - 1)
    return points, np.column_stack([steps, steps + 1])


def koch(depth):
    """Koch's curve from (0, 0, 0) to (1, 0, 0), as complex numbers: 4^depth segments."""
    generator = np.array([0, 1 / 3, 0.5 + np.sqrt(3) / 6 * 1j, 2 / 3])
    z = np.array([0, 1 + 0j])
    for _ in range(depth):
        z = np.append((z[:-1, None] + np.diff(z)[:, None] * generator).ravel(), z[-1])
    return polyline(np.column_stack([z.real, z.imag]))


def dragon(depth):
    """Heighway's dragon: right angles folded `depth` times, 2^depth segments on a square lattice, from 0 to 1."""
    z = np.array([0, 1 + 0j])
    for _ in range(depth):
        z = np.concatenate([z, (z[-1] + 1j * (z - z[-1]))[-2::-1]])
    z /= z[-1]
    return polyline(np.column_stack([z.real, z.imag]))


def spring(turns, steps):
    """A coil of radius 1, `steps` segments a turn, a third of the radius from one turn to the next."""
    angle = np.arange(turns * steps + 1) * 2 * np.pi / steps
    return polyline(np.column_stack([np.cos(angle), np.sin(angle), angle / (6 * np.pi)]))


def tray(columns, rows, steps=24):
    """Rings of radius 1 that rise and fall three times, side by side as parts on a plate, 3.4 from one to the next."""
    angle = np.arange(steps) * 2 * np.pi / steps
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.sin(3 * angle)])
    places = [[3.4 * i, 3.4 * j, 0] for i, j in product(range(columns), range(rows))]
    sides = np.column_stack([np.arange(steps), np.roll(np.arange(steps), -1)])
    return np.concatenate([ring + place for place in places]), np.concatenate([sides + steps * k for k in range(len(places))])


def sierpinski_wire(depth):
    """The edges of the 3^depth triangles of side 2^-depth, with shared vertices."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(3) / 2, 0]])
    triangles = corners[None]
    for _ in range(depth):
        triangles = ((triangles[:, None] + corners[None, :, None]) / 2).reshape(-1, 3, 3)
    edges = np.arange(3 * len(triangles)).reshape(-1, 3)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return weld(triangles.reshape(-1, 3), edges)


def hilbert(order):
    """The Hilbert curve through the 8^order points of a cubic lattice (Skilling 2004), scaled to the unit cube."""
    points = []
    for index in range(8**order):
        x = [0, 0, 0]
        for bit in range(3 * order):
            x[bit % 3] = 2 * x[bit % 3] + (index >> (3 * order - 1 - bit) & 1)
        carry = x[2] >> 1
        x = [x[0] ^ carry, x[1] ^ x[0], x[2] ^ x[1]]
        for level in range(1, order):
            high, low = 1 << level, (1 << level) - 1
            for axis in (2, 1, 0):
                swap = low if x[axis] & high else 0
                change = (x[0] ^ x[axis]) & low & ~swap
                x[0] ^= swap | change
                x[axis] ^= change
        points.append(x)
    return polyline(np.array(points) / (2**order - 1))


def frame(direction):
    """Two unit vectors across a unit vector."""
    help_axis = np.array([1.0, 0, 0]) if abs(direction[0]) < 0.9 else np.array([0, 1.0, 0])
    u = np.cross(direction, help_axis)
    u /= np.linalg.norm(u)
    return u, np.cross(direction, u)


def tree(segments, seed=1):
    """A ternary tree, breadth first: each child 0.7 of its parent, a third of a turn apart (jittered), tilted by 25 to 45 degrees."""
    random = uniform(seed)
    points, edges = [np.zeros(3), np.array([0, 0, 1.0])], [(0, 1)]
    for parent in range(segments):
        start, end = edges[parent]
        stem = points[end] - points[start]
        length = np.linalg.norm(stem)
        direction = stem / length
        u, v = frame(direction)
        for child in range(3):
            if len(edges) == segments:
                return np.array(points), np.array(edges)
            turn = 2 * np.pi * (child / 3 + next(random))
            tilt = np.radians(25 + 20 * next(random))
            way = np.cos(tilt) * direction + np.sin(tilt) * (np.cos(turn) * u + np.sin(turn) * v)
            edges.append((end, len(points)))
            points.append(points[end] + 0.7 * length * way)


def random_tree(segments, seed=3):
    """Each segment grows from a random earlier vertex in a random direction, of length 0.02 to 0.12."""
    random = uniform(seed)
    points, edges = [np.zeros(3)], []
    for index in range(segments):
        parent = int(next(random) * len(points))
        z, turn = 2 * next(random) - 1, 2 * np.pi * next(random)
        way = np.array([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
        points.append(points[parent] + (0.02 + 0.1 * next(random)) * way)
        edges.append((parent, index + 1))
    return np.array(points), np.array(edges)


def random_segments(count, seed=4):
    """Loose segments of length 0.05 to 0.25 with their middles in the unit cube."""
    random = uniform(seed)
    numbers = np.array([[next(random) for _ in range(6)] for _ in range(count)])
    z, turn = 2 * numbers[:, 3] - 1, 2 * np.pi * numbers[:, 4]
    way = np.column_stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])
    half = (0.05 + 0.2 * numbers[:, 5:]) / 2 * way
    return np.concatenate([numbers[:, :3] - half, numbers[:, :3] + half]), np.column_stack([np.arange(count), count + np.arange(count)])


def height_field(n, height):
    """z = height(x) height(y) on an n x n grid of the unit square, each cell cut from its lower left to its upper right."""
    x = np.arange(n + 1) / n
    z = height(x)
    points = np.column_stack([np.tile(x, n + 1), np.repeat(x, n + 1), np.outer(z, z).ravel()])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + 1, a + n + 2, a + n + 1
    return points, np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)


def takagi(n, terms=7):
    """Takagi's function in both directions."""
    return height_field(n, lambda x: sum(np.abs(2.0**k * x - np.round(2.0**k * x)) / 2.0**k for k in range(terms)))


def weierstrass(n, terms=6):
    """Weierstrass's function with a = 0.6, b = 3 in both directions, at 0.35 of its height."""
    return height_field(n, lambda x: 0.35 * sum(0.6**k * np.cos(3.0**k * np.pi * x) for k in range(terms)) + 0.3)


# Bezier control points of a pot: its profile (radius, height), and the spines of handle and spout as
# (x, z), half width in the plane of symmetry, half width across it, and the direction of the first.
PROFILES = [
    [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    [(1.5, 2.4), (1.75, 1.875), (2, 1.35), (2, 0.9)],
    [(2, 0.9), (2, 0.45), (1.5, 0.225), (1.5, 0.15)],
    [(1.5, 0.15), (1.5, 0.075), (1.425, 0), (0, 0)],
    [(0, 3.15), (0.8, 3.15), (0, 2.85), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
]
SPINES = [
    [((-1.6, 2.025), 0.17, 0.3, (0, 1)), ((-2.3, 2.025), 0.17, 0.3, (0, 1)),
     ((-2.85, 2.025), 0.2, 0.3, (-0.7071, 0.7071)), ((-2.85, 1.65), 0.2, 0.3, (-1, 0))],
    [((-2.85, 1.65), 0.2, 0.3, (-1, 0)), ((-2.85, 1.275), 0.2, 0.3, (-1, 0)),
     ((-2.6, 0.9), 0.15, 0.3, (-0.7071, -0.7071)), ((-1.95, 0.7), 0.15, 0.3, (-0.2, -0.98))],
    [((1.7, 0.9), 0.5, 0.66, (0, -1)), ((2.6, 0.9), 0.5, 0.66, (0.2, -0.98)),
     ((2.3, 2.0), 0.15, 0.25, (0.7071, -0.7071)), ((3.1, 2.4), 0.12, 0.2, (0.6, -0.8))],
]


def teapot(n):
    """A pot after Newell's: body, rim and lid turned, handle and spout swept, 36 bicubic Bezier patches, n x n cells each.
    A turned quarter is the cubic that passes for a quarter of a circle (3e-4 off)."""
    k = 4 / 3 * (np.sqrt(2) - 1)
    quarters = [[(1, 0), (1, k), (k, 1), (0, 1)]]
    for _ in range(3):
        quarters.append([(-y, x) for x, y in quarters[-1]])
    patches = [[[(radius * x, radius * y, z) for x, y in quarter] for radius, z in profile]
               for profile in PROFILES for quarter in quarters]
    patches += [[[(cx + w * x * nx, across * y, cz + w * x * nz) for x, y in quarter] for (cx, cz), w, across, (nx, nz) in spine]
                for spine in SPINES for quarter in quarters]
    t = np.linspace(0, 1, n + 1)
    bernstein = np.column_stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    points = np.einsum("ua,vb,pabc->puvc", bernstein, bernstein, np.array(patches, float)).reshape(-1, 3)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corner = (np.arange(len(patches))[:, None] * (n + 1) ** 2 + corner).ravel()
    a, b, c, d = corner, corner + n + 1, corner + n + 2, corner + 1
    return weld(points, np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3))


def patch(place, n, m):
    """A surface over the unit square, n x m squares halved; corners at one place are one."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    corner = (np.arange(n)[:, None] * (m + 1) + np.arange(m)).ravel()
    a, b, c, d = corner, corner + m + 1, corner + m + 2, corner + 1
    return weld(np.stack(place(u, v), axis=-1).reshape(-1, 3), np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3))


def torus(n, m, ring=1.0, tube=0.4):
    """A torus, n steps along the ring and m around the tube."""

    def place(u, v):
        out = ring + tube * np.cos(2 * np.pi * v)
        return out * np.cos(2 * np.pi * u), out * np.sin(2 * np.pi * u), tube * np.sin(2 * np.pi * v)

    return patch(place, n, m)


def mobius(n, m, wide=0.6):
    """Moebius's strip."""

    def place(u, v):
        half, across = np.pi * u, wide * (v - 0.5)
        out = 1 + across * np.cos(half)
        return out * np.cos(2 * half), out * np.sin(2 * half), across * np.sin(half)

    return patch(place, n, m)


def enneper(n, m, wide=2.4):
    """Enneper's minimal surface."""

    def place(u, v):
        x, y = wide * (u - 0.5), wide * (v - 0.5)
        return x - x**3 / 3 + x * y**2, y - y**3 / 3 + y * x**2, x**2 - y**2

    return patch(place, n, m)


def bumpy(n, m):
    """A ball with five bumps around."""

    def place(u, v):
        turn, tilt = 2 * np.pi * u, np.pi * v
        out = 1 + 0.15 * np.sin(5 * turn) * np.sin(tilt) ** 3 * np.cos(2 * tilt)
        return out * np.sin(tilt) * np.cos(turn), out * np.sin(tilt) * np.sin(turn), out * np.cos(tilt)

    return patch(place, n, m)


def level_set(value, n, reach):
    """Where a function is zero, by marching tetrahedra over n cubes along each side of a box, halved along their diagonals (Kuhn); the normals lead to where it is positive."""
    ticks = np.linspace(-reach, reach, n + 1)
    places = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    values = value(*places.T)
    strides = np.array([(n + 1) ** 2, n + 1, 1])
    cubes = (np.stack(np.meshgrid(*3 * [np.arange(n)], indexing="ij"), axis=-1).reshape(-1, 3) * strides).sum(axis=1)
    points, triangles = [], []
    for order in permutations(range(3)):
        corners = cubes[:, None] + np.concatenate([[0], np.cumsum(strides[list(order)])])
        is_low = values[corners] < 0
        for few in (1, 2):
            # One corner alone on its side, or two.
            for is_few in (is_low, ~is_low)[: 3 - few]:
                is_cut = is_few.sum(axis=1) == few
                cut = np.take_along_axis(corners[is_cut], np.argsort(~is_few[is_cut], axis=1, kind="stable"), axis=1)
                pairs = {1: [(0, 1), (0, 2), (0, 3)], 2: [(0, 2), (0, 3), (1, 3), (1, 2)]}[few]
                ends = np.sort(np.stack([cut[:, pair] for pair in pairs], axis=1), axis=2)
                low, high = values[ends[..., 0]], values[ends[..., 1]]
                share = (low / (low - high))[..., None]
                polygon = places[ends[..., 0]] * (1 - share) + places[ends[..., 1]] * share
                out = places[cut][:, few:].mean(axis=1) - places[cut][:, :few].mean(axis=1)
                out = out if is_few is is_low else -out
                for k in range(1, len(pairs) - 1):
                    a, b, c = polygon[:, 0], polygon[:, k], polygon[:, k + 1]
                    is_in = (np.cross(b - a, c - a) * out).sum(axis=1) < 0
                    b, c = np.where(is_in[:, None], c, b), np.where(is_in[:, None], b, c)
                    triangles.append(sum(map(len, points)) + np.arange(3 * len(a)).reshape(3, -1).T)
                    points.append(np.concatenate([a, b, c]))
    return weld(np.concatenate(points), np.concatenate(triangles))


def pebble(n):
    """A round body of a level set, as scanners and implicit modellers write it: with short sides and slivers all over."""

    def value(x, y, z):
        return np.sqrt(x * x + y * y + z * z) - 1 + 0.06 * np.sin(3 * x + 1) * np.cos(3 * y) + 0.05 * np.sin(4 * z + 2 * x)

    return level_set(value, n, 1.25)


def together(parts):
    """Parts as one, with one vertex for all at a place."""
    counts = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    return weld(np.concatenate([vertices for vertices, _ in parts]), np.concatenate([cells + count for (_, cells), count in zip(parts, counts)]))


def lens(n, m, wide=1.3):
    """Two caps of balls of a radius that meet at a sharp rim of radius 1."""
    half = np.arcsin(1 / wide)

    def cap(side):
        def place(u, v):
            turn, tilt = 2 * np.pi * u, half * v
            return wide * np.sin(tilt) * np.cos(turn), wide * np.sin(tilt) * np.sin(turn), side * wide * (np.cos(tilt) - np.cos(half))

        return patch(place, n, m)

    return together([cap(1), cap(-1)])


def drum(n, m):
    """A barrel with a dome at each end, sharp rims between them."""

    def side(u, v):
        out = 1 + 0.3 * np.sin(np.pi * v)
        return out * np.cos(2 * np.pi * u), out * np.sin(2 * np.pi * u), 2 * v

    def dome(end, up):
        return lambda u, v: (v * np.cos(2 * np.pi * u), v * np.sin(2 * np.pi * u), end + 0.3 * up * (1 - v * v))

    return together([patch(side, n, m), patch(dome(0, -1), n, m // 2), patch(dome(2, 1), n, m // 2)])


def cushion(n):
    """A cube whose faces bulge: sharp edges, and corners where three of them meet."""

    def face(axis, side):
        def place(u, v):
            a, b = 2 * u - 1, 2 * v - 1
            return np.roll(np.stack([side * (1 + 0.25 * (1 - a * a) * (1 - b * b)), side * a, b]), axis, axis=0)

        return patch(place, n, n)

    return together([face(axis, side) for axis in range(3) for side in (1, -1)])


def sierpinski_tetrahedron(depth):
    """The faces of the 4^depth tetrahedra of side 2^-depth."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(3) / 2, 0], [0.5, np.sqrt(3) / 6, np.sqrt(2 / 3)]])
    cells = corners[None]
    for _ in range(depth):
        cells = ((cells[:, None] + corners[None, :, None]) / 2).reshape(-1, 4, 3)
    faces = 4 * np.arange(len(cells))[:, None, None] + np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    return cells.reshape(-1, 3), faces.reshape(-1, 3)


def boundary(solid):
    """The boundary of unit cubes, two triangles for each face; vertices are not welded."""
    quads = []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        change = np.diff(np.pad(solid, 1).astype(int), axis=axis)
        for step in (1, -1):
            place = np.argwhere(change == step) - 1
            place[:, axis] += 1
            quads.append(np.stack([place, place + u, place + u + v, place + v][::-step], axis=1))
    quads = np.concatenate(quads)
    triangles = 4 * np.arange(len(quads))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return quads.reshape(-1, 3), triangles.reshape(-1, 3)


def grating(columns, rows):
    """The boundary of a plate, two thick, with square holes, two wide and two from each other; two triangles for each unit square."""
    x, y = (np.arange(4 * count + 2) % 4 > 1 for count in (columns, rows))
    solid = np.repeat(~(x[:, None] & y)[:, :, None], 2, axis=2)
    return weld(*boundary(solid))


def menger(depth):
    """The boundary of the Menger sponge in the unit cube, two triangles for each face of a cube of side 3^-depth."""
    n = 3**depth
    solid = np.ones((n, n, n), bool)
    for level in range(depth):
        middle = np.arange(n) // 3**level % 3 == 1
        x, y, z = middle[:, None, None], middle[:, None], middle
        solid &= ~((x & y) | (y & z) | (z & x))
    vertices, triangles = boundary(solid)
    return weld(vertices / n, triangles)


def cantor_dust(depth):
    """The 8^depth corners of Cantor's dust in the unit cube: lattice planes and ties everywhere."""
    line = np.array([0.0])
    for level in range(depth):
        line = np.concatenate([line, line + 2 / 3 ** (level + 1)])
    points = np.array(list(product(sorted(line), repeat=3)))
    return points, np.arange(len(points))[:, None]


def random_points(count, seed=5):
    """Points in the unit cube."""
    random = uniform(seed)
    return np.array([[next(random) for _ in range(3)] for _ in range(count)]), np.arange(count)[:, None]


def turned(made):
    """A shape turned about two axes, moved, and rounded to single precision, as parts in files are."""
    vertices, cells = made
    a, b = 0.7, 0.4
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    if vertices.shape[1] == 2:
        vertices = np.column_stack([vertices, np.zeros(len(vertices))])
    return (vertices @ (about_z @ about_x).T + [13.7, -4.2, 8.8]).astype(np.float32).astype(float), cells


# The first eight are those of the project's comparison; the others are more of the same kinds.
SHAPES = {
    "koch5": lambda: koch(5),
    "hilbert4": lambda: hilbert(4),
    "sierp7": lambda: sierpinski_wire(7),
    "tree20k": lambda: tree(20000),
    "takagi128": lambda: takagi(128),
    "teapot": lambda: teapot(32),
    "tetra6": lambda: sierpinski_tetrahedron(6),
    "menger3": lambda: menger(3),
    "dragon11": lambda: dragon(11),
    "randomtree4k": lambda: random_tree(4000),
    "segments1k": lambda: random_segments(1000),
    "weierstrass96": lambda: weierstrass(96),
    "cantor4": lambda: cantor_dust(4),
    "points3k": lambda: random_points(3000),
    "sierp7turned": lambda: turned(sierpinski_wire(7)),
    "grating": lambda: grating(12, 8),
    "gratingturned": lambda: turned(grating(12, 8)),
    "spring": lambda: spring(20, 64),
    "tray": lambda: turned(tray(8, 8)),
    "torus": lambda: torus(128, 64),
    "mobius": lambda: mobius(256, 32),
    "enneper": lambda: enneper(128, 128),
    "bumpy": lambda: bumpy(192, 96),
    "lens": lambda: lens(128, 48),
    "drum": lambda: drum(128, 48),
    "cushion": lambda: cushion(48),
    "pebble": lambda: pebble(40),
}
MAIN = list(SHAPES)[:8]


def shape(name):
    """The shape of a name."""
    vertices, cells = SHAPES[name]()
    return Shape(name, np.ascontiguousarray(vertices, float), np.ascontiguousarray(cells, np.int32))


def main():
    """Writes the shapes."""
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or SHAPES:
        made = shape(name)
        made.write(folder / f"{name}.obj")
        kind = ("points", "segments", "triangles")[made.cells.shape[1] - 1]
        print(f"{name}: {len(made.vertices)} vertices, {len(made.cells)} {kind}, radius {made.radius:.9g}")


if __name__ == "__main__":
    main()
