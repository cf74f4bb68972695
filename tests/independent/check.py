"""Reads fabrication files back with other people's libraries and says what is in them.

    check.py < requests > reports

One JSON document per line: a request is `{"file": PATH, "opinions": true}`, its report follows at once. With `"sections": SVG` or DXF and `"heights"`, the
drawing of the file's sections across Z is held against those of trimesh, as polygons of shapely.
DXF files are read, and audited, by ezdxf.
STL is read by trimesh and 3MF by lib3mf in strict mode, the reader of the 3MF consortium. PLY is read by trimesh, as a map of thickness, which is held
against rays. Counts come from our
own page of numpy below; if asked, also from trimesh and from Manifold, and self-intersections from CGAL through libigl
with exact arithmetic. Whoever reads the reports compares them; nothing is judged here.
"""
import json
import re
import sys

import ezdxf
import igl.copyleft.cgal as cgal
import lib3mf
import manifold3d
import numpy as np
import shapely
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def weld(points):
    """Vertices and triangles of a triangle soup; equal coordinates are one vertex."""
    vertices, index = np.unique(points.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    return vertices, index.reshape(-1, 3)


def read_stl(path):
    """Vertices, triangles and remarks."""
    soup = trimesh.load(path, file_type="stl", process=False)
    vertices, triangles = weld(np.asarray(soup.triangles, dtype=np.float64))
    return vertices, triangles, {"reader": "trimesh " + trimesh.__version__}


def read_3mf(path):
    """The single mesh of a 3MF file, as its build item places it, and the strict reader's remarks."""
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(path)
    warnings = [reader.GetWarning(k) for k in range(reader.GetWarningCount())]
    items, iterator = [], model.GetBuildItems()
    while iterator.MoveNext():
        items.append(iterator.GetCurrent())
    objects, iterator = [], model.GetMeshObjects()
    while iterator.MoveNext():
        objects.append(iterator.GetCurrentMeshObject())
    if len(items) != 1 or len(objects) != 1 or items[0].HasObjectTransform():
        raise ValueError(f"{len(items)} build items, {len(objects)} meshes")
    mesh = objects[0]
    vertices = np.frombuffer(b"".join(map(bytes, mesh.GetVertices())), dtype=np.float32).reshape(-1, 3).astype(np.float64)
    triangles = np.frombuffer(b"".join(map(bytes, mesh.GetTriangleIndices())), dtype=np.uint32).reshape(-1, 3).astype(np.int64)
    millimetres = model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    remarks = {"warnings": warnings, "millimetres": millimetres, "valid": mesh.IsValid(), "oriented": mesh.IsManifoldAndOriented()}
    return vertices, triangles, {"reader": "lib3mf", "lib3mf": remarks}


def first_hits(vertices, triangles, sign):
    """From the middle of every face along its normal, times a sign: the way to the first face without a common corner (Moeller and Trumbore, 1997)."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    p, q = b - a, c - a
    normals = np.cross(p, q)
    directions = sign * normals / np.linalg.norm(normals, axis=1)[:, None]
    first = np.full(len(triangles), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k, (corners, direction) in enumerate(zip(triangles, directions)):
            offset = vertices[corners].mean(axis=0) - a
            across, turned = np.cross(direction, q), np.cross(offset, p)
            determinant = np.einsum("ij,ij->i", p, across)
            u = np.einsum("ij,ij->i", offset, across) / determinant
            v = turned @ direction / determinant
            way = np.einsum("ij,ij->i", q, turned) / determinant
            apart = ~np.isin(triangles, corners).any(axis=1)
            hit = apart & (u >= 0) & (v >= 0) & (u + v <= 1) & (way > 0)
            first[k] = way[hit].min(initial=np.inf)
    return first


def read_ply(path):
    """Vertices, triangles and remarks of a map of thickness."""
    mesh = trimesh.load(path, file_type="ply", process=False)
    raw = mesh.metadata["_ply_raw"]
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    fields = {}
    for name, sign in (("wall_mm", -1.0), ("gap_mm", 1.0)):
        at_vertices, on_faces = (raw[element]["data"][name].astype(np.float64) for element in ("vertex", "face"))
        least = np.full(len(vertices), np.inf)
        np.minimum.at(least, triangles.ravel(), np.repeat(on_faces, 3))
        rays = first_hits(vertices, triangles, sign)
        finite = np.isfinite(on_faces) & np.isfinite(rays)
        fields[name] = {
            "infinite": int(np.isinf(on_faces).sum()), "off_at_vertices": int((at_vertices != least).sum()),
            # Single precision, of coordinates and of lengths.
            "above_a_ray": int((on_faces > rays + 1e-6 * np.abs(vertices).max()).sum()),
            "below_its_ray_by": float((rays[finite] - on_faces[finite]).max(initial=0.0)),
        }
    return vertices, triangles, {"reader": "trimesh " + trimesh.__version__, "map": fields}


READERS = {".3mf": read_3mf, ".ply": read_ply}


def pairs(count, first, second):
    """Number and labels of the classes of a relation."""
    ones = np.ones(len(first), dtype=np.int8)
    return connected_components(coo_matrix((ones, (first, second)), shape=(count, count)), directed=False)


def counts(vertices, triangles):
    """Counts of the topology, by sorting half-edges."""
    total = len(triangles)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.lexsort((high, low))
    new = np.ones(len(order), dtype=bool)
    new[1:] = (low[order][1:] != low[order][:-1]) | (high[order][1:] != high[order][:-1])
    first = np.flatnonzero(new)
    uses = np.diff(np.append(first, len(order)))
    one, two = order[first[uses == 2]], order[first[uses == 2] + 1]
    flipped = start[one] == start[two]
    # A corner is known by the half-edge that leaves it; across an edge, the corners at each of its ends belong to
    # one fan. A half-edge's far corner is the next one of its triangle.
    following = lambda h: h - h % 3 + (h + 1) % 3
    far_one, far_two = following(one), following(two)
    joined = [np.where(flipped, two, far_two), np.where(flipped, far_two, two)]
    fans, _ = pairs(3 * total, np.concatenate([one, far_one]), np.concatenate(joined))
    shells, label = pairs(total, one // 3, two // 3)
    a, b, c = (vertices[triangles[:, k]] - vertices.mean(axis=0) for k in range(3))
    volume = np.bincount(label, weights=np.einsum("ij,ij->i", a, np.cross(b, c)) / 6, minlength=shells)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    used = len(np.unique(triangles))
    euler = used - len(first) + total
    return {
        "vertices": used, "edges": len(first), "triangles": total, "euler": euler, "shells": int(shells),
        "components": int((volume > 0).sum()), "cavities": int((volume < 0).sum()), "genus": int(shells) - euler // 2,
        "boundary_edges": int((uses == 1).sum()), "nonmanifold_edges": int((uses > 2).sum()),
        "nonmanifold_vertices": int(fans - used), "flipped_pairs": int(flipped.sum()),
        "degenerate_triangles": int((area == 0).sum()), "volume": float(volume.sum()), "area": float(area.sum()),
        "box": [vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()],
    }


def second_opinions(vertices, triangles):
    """What trimesh, Manifold and CGAL think."""
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    solid = manifold3d.Manifold(manifold3d.Mesh64(vertices, triangles.astype(np.uint64)))
    status = str(solid.status()).rsplit(".", 1)[-1]
    # The pairs that cross are the third of the five arrays.
    crossings = cgal.remesh_self_intersections(vertices, triangles.astype(np.int32), detect_only=True)[2]
    return {
        "trimesh": {"watertight": bool(mesh.is_watertight), "winding": bool(mesh.is_winding_consistent),
                    "volume": float(mesh.volume), "euler": int(mesh.euler_number)},
        "manifold": {"status": status, "volume": float(solid.volume()), "shells": len(solid.decompose())},
        "self_intersections": int(np.asarray(crossings).reshape(-1, 2).shape[0]),
    }


def drawn_layers(path):
    """What an odd number of the loops of every layer of a DXF file surrounds. The file must have nothing to mend in it, and be in millimetres; the audit adds Defpoints."""
    drawing = ezdxf.readfile(path)
    audit = drawing.audit()
    remarks = [entry.message for entry in [*audit.errors, *audit.fixes]]
    if remarks or drawing.units != ezdxf.units.MM:
        raise ValueError(f"units {drawing.units}, {remarks}")
    sections = {layer.dxf.name: shapely.MultiPolygon() for layer in drawing.layers if layer.dxf.name not in ("0", "Defpoints")}
    for loop in drawing.modelspace():
        if not loop.closed:
            raise ValueError(f"{loop} is open")
        name = loop.dxf.layer
        sections[name] = sections[name].symmetric_difference(shapely.Polygon(loop.get_points("xy")))
    return list(sections.values())


def drawn_sections(path):
    """The polygons of every group of a drawing: a path is one of them, its outline first; v is upwards, SVG's y downwards."""
    if path.endswith(".dxf"):
        return drawn_layers(path)
    with open(path, encoding="utf-8") as file:
        groups = file.read().split('<g id="z_')[1:]
    sections = []
    for group in groups:
        polygons = []
        for drawn in re.findall(r'<path d="([^"]*)"', group):
            runs = [re.split("[L ]", run.rstrip("z")) for run in drawn.split("M")[1:]]
            rings = [np.array(run, dtype=np.float64).reshape(-1, 2) * [1, -1] for run in runs]
            polygons.append(shapely.Polygon(rings[0], rings[1:]))
        sections.append(shapely.MultiPolygon(polygons))
    return sections


def cut_section(mesh, height):
    """Trimesh's loops in a plane; what an odd number of them surrounds is inside."""
    cut = mesh.section(plane_origin=[0, 0, height], plane_normal=[0, 0, 1])
    inside = shapely.MultiPolygon()
    for loop in cut.discrete if cut is not None else []:
        inside = inside.symmetric_difference(shapely.Polygon(loop[:, :2]))
    return inside


def compared_sections(mesh, heights, drawing):
    """Of each section the area, perimeter, outlines and holes on both sides, and the area that only one of them covers."""
    found = []
    for height, ours in zip(heights, drawn_sections(drawing), strict=True):
        theirs = cut_section(mesh, height)
        sides = [{"area": side.area, "perimeter": side.length, "outlines": len(parts),
                  "holes": sum(len(part.interiors) for part in parts), "valid": bool(side.is_valid)}
                 for side, parts in ((ours, shapely.get_parts(ours)), (theirs, shapely.get_parts(theirs)))]
        apart = ours.symmetric_difference(theirs).area if ours.is_valid else None
        found.append({"height": height, "ours": sides[0], "theirs": sides[1], "apart": apart})
    return found


def report(request):
    """The report on one file."""
    path = request["file"]
    vertices, triangles, remarks = READERS.get(path[-4:], read_stl)(path)
    opinions = second_opinions(vertices, triangles) if request.get("opinions") else {}
    if "sections" in request:
        mesh = trimesh.Trimesh(vertices, triangles, process=False)
        remarks["sections"] = compared_sections(mesh, request["heights"], request["sections"])
    return {**remarks, "finite": bool(np.isfinite(vertices).all()), **counts(vertices, triangles), **opinions}


def main():
    """Answers until the requests end."""
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = report(request)
        except Exception as problem:  # a file that cannot be read is a finding, not an end
            answer = {"problem": f"{type(problem).__name__}: {problem}"}
        print(json.dumps({"file": request["file"], **answer}), flush=True)


if __name__ == "__main__":
    main()
