"""One run of one Python peer, in a process of its own: time and memory are those of the work, not of reading or writing.

    python programs.py PROGRAM SHAPE RADIUS PARAMETER OUT.bin

manifold: the union of the convex hulls of balls at each cell's corners; the parameter is the number of sides of a great circle.
meshlib, libigl: level set of the distance on a grid; the parameter is its spacing.
"""
import json
import sys
import time

import numpy as np

from inputs import shape
from judge import write_mesh


def manifold(made, radius, sides):
    """Hulls and one batch union. A polyhedral ball between the spheres of radius q and 1 is scaled by 2 r / (1 + q), which
    halves its error."""
    import manifold3d as m

    ball = m.Manifold.sphere(1.0, int(sides)).to_mesh64()
    points = np.asarray(ball.vert_properties)[:, :3]
    corners = points[np.asarray(ball.tri_verts, np.int64)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inner = (np.einsum("ij,ij->i", normals, corners[:, 0]) / np.linalg.norm(normals, axis=1)).min()
    points = points * (2 * radius / (1 + inner))
    hulls = [m.Manifold.hull_points((made.vertices[cell][:, None] + points).reshape(-1, 3)) for cell in made.cells]
    union = m.Manifold.batch_boolean(hulls, m.OpType.Add).to_mesh64()
    return np.asarray(union.vert_properties)[:, :3], np.asarray(union.tri_verts)


def chains(segments):
    """Vertices of the runs of segments that each go on where the last one ended."""
    runs = np.split(segments, 1 + np.flatnonzero(segments[1:, 0] != segments[:-1, 1]))
    return [np.append(run[:, 0], run[-1, 1]) for run in runs]


def meshlib(made, radius, spacing):
    """Marching cubes of the unsigned distance."""
    from meshlib import mrmeshnumpy, mrmeshpy

    settings = mrmeshpy.OffsetParameters()
    settings.voxelSize = spacing
    settings.signDetectionMode = mrmeshpy.SignDetectionMode.Unsigned
    if made.cells.shape[1] == 3:
        mesh = mrmeshnumpy.meshFromFacesVerts(made.cells.astype(np.int32), made.vertices.astype(np.float32))
        result = mrmeshpy.mcOffsetMesh(mrmeshpy.MeshPart(mesh), radius, settings)
    elif made.cells.shape[1] == 2:
        contours = mrmeshpy.std_vector_std_vector_Vector3_float()
        for chain in chains(made.cells):
            contour = mrmeshpy.std_vector_Vector3_float()
            for corner in made.vertices[chain]:
                contour.append(mrmeshpy.Vector3f(*map(float, corner)))
            contours.append(contour)
        result = mrmeshpy.offsetPolyline(mrmeshpy.Polyline3(contours), radius, settings)
    else:
        sys.exit("it has no offset of points")
    result.packOptimally()
    return mrmeshnumpy.getNumpyVerts(result), mrmeshnumpy.getNumpyFaces(result.topology)


def libigl(made, radius, spacing):
    """Marching cubes of the exact distance on a full grid."""
    import igl

    low, high = made.vertices.min(axis=0) - radius - 2 * spacing, made.vertices.max(axis=0) + radius + 2 * spacing
    counts = np.ceil((high - low) / spacing).astype(int) + 1
    if np.prod(counts, dtype=float) > 3e8:
        sys.exit(f"a grid of {np.prod(counts, dtype=float):.2g} points")
    x, y, z = (low[a] + spacing * np.arange(counts[a]) for a in range(3))
    grid = np.stack(np.broadcast_arrays(x[None, None, :], y[None, :, None], z[:, None, None]), axis=-1).reshape(-1, 3)
    square, _, _ = igl.point_mesh_squared_distance(grid, made.vertices, made.cells.astype(np.int64))
    vertices, triangles = igl.marching_cubes(np.sqrt(square), grid, *map(int, counts), radius)[:2]
    return vertices, triangles


def outward(vertices, triangles):
    """Triangles turned so that the volume is positive: a matter of convention."""
    corner = np.asarray(vertices, float)[np.asarray(triangles, np.int64)]
    volume = np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2]))
    return triangles if volume > 0 else np.asarray(triangles)[:, ::-1]


def main():
    """Runs one."""
    program, name, radius, parameter, path = sys.argv[1:]
    made = shape(name)
    run = {"manifold": manifold, "meshlib": meshlib, "libigl": libigl}[program]
    __import__({"manifold": "manifold3d", "meshlib": "meshlib.mrmeshpy", "libigl": "igl"}[program])
    wall, cpu = time.perf_counter(), time.process_time()
    vertices, triangles = run(made, float(radius), float(parameter))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    with open("/proc/self/status") as status:
        peak = next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))
    write_mesh(path, vertices, outward(vertices, triangles))
    print(json.dumps({"cpu": cpu, "wall": wall, "peak_mb": peak / 1024}))


if __name__ == "__main__":
    main()
