"""How cost and triangles of lacuna grow: over a decade of tolerances, and over a decade of sizes.

    python sweep.py --work FOLDER --lacuna ADAPTER [--results FILE]

The tolerance goes from r/5 to r/50 at one radius. A shape ten times as large at the same radius and tolerance is the same shape
at a tenth of the radius and of the tolerance, so the sizes are radii from r to r/10 with e = radius/10. Every result is judged.
"""
import argparse
import json
from pathlib import Path

import numpy as np

from compare import command, run
from inputs import Shape, shape
from judge import HERE, compiled, judge, read_mesh

SWEPT = ("koch5", "hilbert4", "takagi128", "tetra6")
TOLERANCES = (5, 7, 10, 14, 20, 28, 40, 50)
SIZES = (1, 1.4, 2, 2.8, 4, 5.6, 8, 10)


def area(vertices, triangles):
    """Of a mesh."""
    corner = vertices[triangles]
    return float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2)


class Thickened(Shape):
    """A shape with a radius of its own."""

    factor = 1.0

    @property
    def radius(self):
        """In parts of the usual one."""
        return 0.01 * self.diagonal * self.factor


def measure(name, size, divisor, options, functions):
    """One run and its verdict."""
    made = shape(name)
    made = Thickened(made.name, made.vertices, made.cells)
    object.__setattr__(made, "factor", 1 / size)
    tolerance, out = made.radius / divisor, options.work / "sweep.bin"
    row = {"shape": name, "size": size, "divisor": divisor, "radius": made.radius, "tolerance": tolerance}
    measured = run(command("lacuna", made, options.work, options.lacuna, tolerance, 1, out), out, options.limit)
    if measured.get("cpu", 99) < 1:
        measured = run(command("lacuna", made, options.work, options.lacuna, tolerance, 5, out), out, options.limit)
    if "failed" in measured:
        return row | measured
    vertices, triangles = read_mesh(out)
    verdict = judge(functions, made, made.radius, tolerance, vertices, triangles)
    return row | measured | {"area": area(vertices, triangles)} | verdict


def main():
    """All sweeps; a shape's larger sizes are left out once a run is over the limit."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--work", type=Path, required=True)
    words.add_argument("--lacuna", type=Path, required=True)
    words.add_argument("--results", type=Path, default=HERE / "results" / "sweep.json")
    words.add_argument("--shapes", default=",".join(SWEPT))
    words.add_argument("--limit", type=float, default=60)
    options = words.parse_args()
    functions, rows = compiled(options.work), []
    for name in options.shapes.split(","):
        for series in ([(1, d) for d in TOLERANCES], [(s, 10) for s in SIZES[1:]]):
            for size, divisor in series:
                row = measure(name, size, divisor, options, functions)
                rows.append(row)
                options.results.write_text("[\n" + ",\n".join(map(json.dumps, rows)) + "\n]\n")
                print(json.dumps(row), flush=True)
                if "failed" in row:
                    break


if __name__ == "__main__":
    main()
