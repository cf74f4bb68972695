"""The judge is judged: closed forms, and meshes with one fault each that it must find.

    python -m unittest test_judge
"""
import tempfile
import unittest

import numpy as np

from inputs import Shape, shape
from judge import Hierarchy, compiled, judge, topology
from truth import Filtration, samples

FUNCTIONS = compiled(tempfile.mkdtemp())


def octahedral_sphere(radius, parts, centre=(0, 0, 0)):
    """The lattice of the octahedron pushed to the sphere: closed, outward."""
    points, triangles = [], []
    for signs in np.array(np.meshgrid([1, -1], [1, -1], [1, -1])).T.reshape(-1, 3):
        index = {}
        for i in range(parts + 1):
            for j in range(parts + 1 - i):
                index[i, j] = len(points)
                points.append(signs * [i, j, parts - i - j])
        turn = 1 if signs.prod() > 0 else -1
        for i, j in index:
            if (i + 1, j) in index and (i, j + 1) in index:
                triangles.append([index[i, j], index[i + 1, j], index[i, j + 1]][::turn])
            if (i + 1, j + 1) in index:
                triangles.append([index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]][::turn])
    unique, inverse = np.unique(np.array(points), axis=0, return_inverse=True)
    unit = unique / np.linalg.norm(unique, axis=1)[:, None]
    return radius * unit + np.array(centre, float), inverse.reshape(-1)[np.array(triangles)].astype(np.int32)


POINT = Shape("point", np.zeros((1, 3)), np.zeros((1, 1), np.int32))


class Band(unittest.TestCase):
    """Errors."""

    def test_sphere_has_the_error_of_its_facets(self):
        vertices, triangles = octahedral_sphere(1.0, 8)
        found = judge(FUNCTIONS, POINT, 1.0, 0.1, vertices, triangles)
        corner = vertices[triangles]
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        height = np.einsum("ij,ij->i", normal, corner[:, 0]) / np.linalg.norm(normal, axis=1)
        self.assertAlmostEqual(found["inner"], 1 - height.min(), delta=1e-12)
        self.assertAlmostEqual(found["outer"], 0, delta=1e-9)
        self.assertEqual([found["genus"], found["shells"], found["crossings"], found["solid"], found["manifold"]], [0, 1, 0, True, True])

    def test_an_error_inside_one_triangle_is_found(self):
        # A triangle over a frame of segments: its corners are at distance 1, its farthest point is the middle of its long side.
        corners = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [10, 10, 0]], float)
        holed = Shape("frame", corners, np.array([[0, 1], [0, 2], [1, 3], [2, 3]], np.int32))
        cover = Hierarchy(FUNCTIONS, np.array([[0, 0, 1], [10, 0, 1], [0, 10, 1.0]]), np.array([[0, 1, 2]], np.int32))
        sites = Hierarchy(FUNCTIONS, holed.vertices, holed.cells)
        least, _, greatest, place = sites.extremes(cover, 0.5, 1e-6)
        grid = np.array([[x, y, 1] for x in np.linspace(0, 10, 401) for y in np.linspace(0, 10, 401) if x + y <= 10])
        self.assertAlmostEqual(least, 1, delta=1e-12)
        self.assertAlmostEqual(greatest, sites.distances(grid).max(), delta=0.03)
        self.assertAlmostEqual(greatest, np.sqrt(26), delta=1e-5)

    def test_extremes_agree_with_dense_samples_of_random_triangles(self):
        random = np.random.default_rng(1)
        for kind in (1, 2, 3):
            points = random.random((30, 3))
            sites = Hierarchy(FUNCTIONS, points, np.arange(30).reshape(-1, kind) if kind != 1 else np.arange(30)[:, None])
            weights = random.dirichlet(np.ones(3), 40000)
            weights[:3] = np.eye(3)
            for _ in range(20):
                corners = 2 * random.random((3, 3)) - 0.5
                triangle = Hierarchy(FUNCTIONS, corners, np.array([[0, 1, 2]]))
                least, _, greatest, _ = sites.extremes(triangle, 0.3, 1e-5)
                distance = sites.distances(weights @ corners)
                self.assertLessEqual(least, distance.min() + 1e-9)
                self.assertGreaterEqual(greatest, distance.max() - 1e-5)
                self.assertAlmostEqual(least, distance.min(), delta=0.03)
                self.assertAlmostEqual(greatest, distance.max(), delta=0.03)

    def test_distances_agree_with_brute_force(self):
        made = shape("koch5")
        points = np.random.default_rng(2).random((200, 3))
        a, b = made.vertices[made.cells[:, 0]], made.vertices[made.cells[:, 1]]
        t = np.clip(np.einsum("pij,ij->pi", points[:, None] - a, b - a) / np.einsum("ij,ij->i", b - a, b - a), 0, 1)
        brute = np.linalg.norm(points[:, None] - a - t[..., None] * (b - a), axis=2).min(axis=1)
        self.assertTrue(np.allclose(Hierarchy(FUNCTIONS, made.vertices, made.cells).distances(points), brute, rtol=0, atol=1e-13))


class Faults(unittest.TestCase):
    """One each."""

    def test_a_missing_ball_is_not_the_solid(self):
        two = Shape("two", np.array([[0, 0, 0], [5, 0, 0.0]]), np.array([[0], [1]], np.int32))
        found = judge(FUNCTIONS, two, 1.0, 0.1, *octahedral_sphere(1.0, 8))
        self.assertLess(found["error"], 0.1)
        self.assertFalse(found["solid"])

    def test_a_filled_void_is_not_the_solid(self):
        inner = octahedral_sphere(3.0, 12)
        hollow = Shape("hollow", *inner)
        outside = octahedral_sphere(4.0, 24)
        cavity = octahedral_sphere(2.0, 24)
        both = np.concatenate([outside[0], cavity[0]]), np.concatenate([outside[1], len(outside[0]) + cavity[1][:, ::-1]]).astype(np.int32)
        right, wrong = judge(FUNCTIONS, hollow, 1.0, 0.1, *both), judge(FUNCTIONS, hollow, 1.0, 0.1, *outside)
        self.assertTrue(right["solid"])
        self.assertEqual([right["shells"], right["cavities"]], [2, 1])
        self.assertFalse(wrong["solid"])

    def test_small_voids_are_counted_far_from_the_origin(self):
        for k in range(40):
            centre = np.array([40.2, 109.9, 118.9]) + 0.37 * k
            vertices, triangles = octahedral_sphere(1.0, 6, centre)
            small, faces = octahedral_sphere(1e-6, 1, centre)
            both = np.concatenate([vertices, small]), np.concatenate([triangles, len(vertices) + faces[:, ::-1]]).astype(np.int32)
            found = topology(*both)
            self.assertEqual([found["shells"], found["cavities"]], [2, 1])

    def test_crossings_are_found(self):
        vertices, triangles = octahedral_sphere(1.0, 6)
        other, more = octahedral_sphere(1.0, 6, (1.0, 0.2, 0.1))
        both = Hierarchy(FUNCTIONS, np.concatenate([vertices, other]), np.concatenate([triangles, more + len(vertices)]))
        apart = Hierarchy(FUNCTIONS, np.concatenate([vertices, other + 5]), np.concatenate([triangles, more + len(vertices)]))
        self.assertGreater(both.crossings()[0], 10)
        self.assertEqual(apart.crossings()[0], 0)

    def test_crossings_of_neighbours_are_found(self):
        crossing = {
            "folded onto each other": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0]], [[0, 1, 2], [1, 0, 3]], 1),
            "side by side": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, -0.3, 0]], [[0, 1, 2], [1, 0, 3]], 0),
            "through, at a vertex": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.2, 1], [0.5, 0.2, -1]], [[0, 1, 2], [0, 3, 4]], 1),
            "away, at a vertex": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.5, 0.2, 1], [-0.5, 0.2, -1]], [[0, 1, 2], [0, 3, 4]], 0),
            "touching, no vertex shared": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0], [1, 1, 1], [0, 1, 1]], [[0, 1, 2], [3, 4, 5]], 1),
            "overlapping in a plane": ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.1, 0.1, 0], [0.2, 0.1, 0], [0.1, 0.2, 0]], [[0, 1, 2], [3, 4, 5]], 1),
        }
        for words, (vertices, triangles, expected) in crossing.items():
            for turn in range(3):
                rolled = np.roll(np.array(triangles, np.int32), turn, axis=1)
                with self.subTest(words):
                    self.assertEqual(Hierarchy(FUNCTIONS, np.array(vertices, float), rolled).crossings()[0], expected)

    def test_holes_and_pinches_are_found(self):
        vertices, triangles = octahedral_sphere(1.0, 4)
        self.assertFalse(topology(vertices, triangles[1:])["manifold"])
        # Two spheres that share a vertex.
        other, more = octahedral_sphere(1.0, 4, (2.0, 0, 0))
        east, west = int(vertices[:, 0].argmax()), int(other[:, 0].argmin())
        more = np.where(more == west, east, more + len(vertices)).astype(np.int32)
        found = topology(np.concatenate([vertices, other]), np.concatenate([triangles, more]))
        self.assertEqual([found["manifold"], found["pinched_vertices"]], [False, 1])


def lengths(made):
    """Of the segments."""
    return np.linalg.norm(np.diff(made.vertices[made.cells], axis=1)[:, 0], axis=1)


def areas(made):
    """Of the triangles."""
    corner = made.vertices[made.cells]
    return np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2


class Shapes(unittest.TestCase):
    """Measures of the shapes that are known in closed form."""

    def test_wires(self):
        for name, count, length in (("koch5", 4**5, 3.0**-5), ("dragon11", 2**11, 2**-5.5), ("sierp7", 3**8, 2.0**-7), ("hilbert4", 8**4 - 1, 1 / 15)):
            made = shape(name)
            with self.subTest(name):
                self.assertEqual(len(made.cells), count)
                self.assertTrue(np.allclose(lengths(made), length, rtol=1e-9))
        self.assertEqual(len(np.unique(np.round(shape("hilbert4").vertices * 15), axis=0)), 8**4)
        self.assertEqual(len(shape("sierp7").vertices), (3**8 + 3) // 2)

    def test_trees(self):
        made = shape("tree20k")
        self.assertEqual([len(made.vertices), len(made.cells)], [20001, 20000])
        generation = np.round(np.log(lengths(made)) / np.log(0.7)).astype(int)
        self.assertTrue(np.array_equal(np.bincount(generation)[:9], 3 ** np.arange(9)))

    def test_surfaces(self):
        self.assertAlmostEqual(areas(shape("tetra6")).sum(), np.sqrt(3), delta=1e-12)
        sponge = shape("menger3")
        self.assertEqual(len(sponge.cells) // 2, 2 * 20**3 + 4 * 8**3)
        self.assertAlmostEqual(areas(sponge).sum(), (2 * 20**3 + 4 * 8**3) / 9**3, delta=1e-9)
        self.assertEqual(topology(sponge.vertices, sponge.cells)["manifold"], True)

    def test_fields_and_dust(self):
        takagi = shape("takagi128").vertices.reshape(129, 129, 3)
        self.assertAlmostEqual(takagi[64, 64, 2], 0.25, delta=1e-15)  # T(1/2) = 1/2
        self.assertAlmostEqual(takagi[32, 64, 2], 0.25, delta=1e-15)  # T(1/4) = 1/2
        dust = shape("cantor4").vertices
        self.assertEqual(len(np.unique(dust, axis=0)), 8**4)
        self.assertFalse(((np.round(dust * 81) // 27 == 1) & (dust != 1 / 3)).any())  # nothing within the middle third


class Truth(unittest.TestCase):
    """Betti numbers that are known."""

    def test_known_dilations(self):
        square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
        ring = Shape("ring", square, np.array([[0, 1], [1, 2], [2, 3], [3, 0]], np.int32))
        cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
        faces = np.array([[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 3, 7], [1, 7, 5]])
        box = Shape("box", cube, faces.astype(np.int32))
        dots = Shape("dots", cube, np.arange(8, dtype=np.int32)[:, None])
        cases = [(ring, 0.49, [1, 1, 0]), (ring, 0.51, [1, 0, 0]), (box, 0.49, [1, 0, 1]), (box, 0.51, [1, 0, 0]),
                 (dots, 0.49, [8, 0, 0]), (dots, 0.55, [1, 5, 0]), (dots, 0.75, [1, 0, 1]), (dots, 0.9, [1, 0, 0])]
        for made, radius, expected in cases:
            filtration = Filtration(samples(made, 0.05 * radius))
            with self.subTest(made.name, radius=radius):
                self.assertEqual(filtration.betti(radius * radius), expected)


if __name__ == "__main__":
    unittest.main()
