"""The types of lacuna's contract 0.1.0.

Generated from api/openapi.json by api/clients/generate.py: do not edit.
"""
from typing import Any, Literal, NotRequired, TypeAlias, TypedDict

AddressAnswer = TypedDict('AddressAnswer', {
    'at': 'NotRequired[LocatedPoint | None]',
    'near': 'NotRequired[NearbyCells | None]',
})

AddressQuestion = TypedDict('AddressQuestion', {
    'at': 'NotRequired[str]',
    'lacuna': 'NotRequired[Literal[1]]',
    'model': 'NotRequired[EmbeddedModel]',
    'model_ref': 'NotRequired[str]',
    'most': 'NotRequired[int]',
    'near': 'NotRequired[list[float]]',
    'tolerance_mm': 'NotRequired[float]',
    'within_mm': 'NotRequired[float]',
})

Adjacency = TypedDict('Adjacency', {
    'between': 'list[list[int]]',
    'permutation': 'NotRequired[list[int]]',
    'reversed': 'NotRequired[bool]',
    'state': 'str',
})

AffineMap: TypeAlias = Any

Batch = TypedDict('Batch', {'jobs': 'list[BatchEntry]', 'lacuna': 'Literal[1]'})

BatchCertificate = TypedDict('BatchCertificate', {
    'batch': 'NotRequired[str | None]',
    'counts': 'Counts',
    'input_digest': 'str',
    'jobs': 'list[BatchRow]',
    'kernel_version': 'str',
    'state': 'BatchState',
})

BatchEntry = TypedDict('BatchEntry', {'job': 'Job', 'name': 'NotRequired[str]'})

BatchRow = TypedDict('BatchRow', {
    'figures': 'NotRequired[Figures | None]',
    'index': 'int',
    'input_digest': 'str',
    'job': 'NotRequired[str | None]',
    'kind': 'JobKind',
    'name': 'NotRequired[str | None]',
    'output_digests': 'NotRequired[dict[str, str]]',
    'problem': 'NotRequired[Problem | None]',
    'progress': 'NotRequired[Step | None]',
    'state': 'JobState',
    'warnings': 'NotRequired[list[str]]',
})

BatchState: TypeAlias = Literal['queued', 'running', 'succeeded', 'partly_succeeded', 'failed', 'cancelled', 'expired']

BatchView = TypedDict('BatchView', {
    'counts': 'Counts',
    'created': 'str',
    'finished': 'NotRequired[str | None]',
    'fraction': 'float',
    'id': 'str',
    'jobs': 'list[BatchRow]',
    'state': 'BatchState',
})

BcifsScheme = TypedDict('BcifsScheme', {
    'family': "Literal['bcifs']",
    'start': 'NotRequired[str]',
    'states': 'list[State]',
})

BcifsShape = TypedDict('BcifsShape', {
    'adjacencies': 'NotRequired[list[Adjacency]]',
    'cells': 'list[RootCell]',
    'family': "Literal['bcifs']",
    'glue': 'NotRequired[list[Glue | list[list[int]]]]',
    'incidences': 'NotRequired[list[Incidence]]',
    'parameters': 'NotRequired[dict[str, float]]',
    'relations': 'NotRequired[list[Relation]]',
    'states': 'list[State]',
})

BetaSplineScheme = TypedDict('BetaSplineScheme', {
    'beta1': 'NotRequired[float]',
    'beta2': 'NotRequired[float]',
    'closed': 'NotRequired[bool]',
    'family': "Literal['beta_spline']",
})

BetaSplineShape = TypedDict('BetaSplineShape', {
    'beta1': 'NotRequired[float]',
    'beta2': 'NotRequired[float]',
    'closed': 'NotRequired[bool]',
    'control_points': 'list[list[float]]',
    'family': "Literal['beta_spline']",
})

BezierCurveShape = TypedDict('BezierCurveShape', {
    'control_points': 'list[ControlPoint]',
    'family': "Literal['bezier_curve']",
    'weights': 'NotRequired[list[float]]',
})

BezierScheme = TypedDict('BezierScheme', {'family': "Literal['bezier_curve']"})

BezierSurfaceShape = TypedDict('BezierSurfaceShape', {
    'control_points': 'list[list[ControlPoint]]',
    'family': "Literal['bezier_surface']",
    'trim': 'NotRequired[Trim]',
    'weights': 'NotRequired[list[list[float]]]',
})

Border = TypedDict('Border', {
    'boundaries': 'NotRequired[list[list[int]]]',
    'part': 'int',
    'side': "NotRequired[Literal['u_min', 'u_max', 'v_min', 'v_max']]",
    'vertices': 'NotRequired[list[int]]',
})

Boundary = TypedDict('Boundary', {'incidence': 'Matrix', 'state': 'str'})

Cage = TypedDict('Cage', {
    'boundary_loops': 'NotRequired[int | None]',
    'edges': 'NotRequired[int | None]',
    'euler': 'NotRequired[int | None]',
    'faces': 'int',
    'faces_by_corners': 'NotRequired[dict[str, int] | None]',
    'faults': 'NotRequired[list[Finding]]',
    'manifold': 'bool',
})

Capabilities = TypedDict('Capabilities', {
    'build': 'NotRequired[str | None]',
    'formats': 'list[FormatCapability]',
    'kernel_version': 'str',
    'kinds': 'list[JobKind]',
    'library': 'list[str]',
    'limits': 'LimitCapability',
    'profiles': 'list[str]',
})

CatmullRomScheme = TypedDict('CatmullRomScheme', {
    'closed': 'NotRequired[bool]',
    'family': "Literal['catmull_rom']",
    'parametrization': "NotRequired[Literal['uniform', 'centripetal', 'chordal']]",
})

CatmullRomShape = TypedDict('CatmullRomShape', {
    'closed': 'NotRequired[bool]',
    'control_points': 'list[list[float]]',
    'family': "Literal['catmull_rom']",
    'parametrization': "NotRequired[Literal['uniform', 'centripetal', 'chordal']]",
})

CellPairStatement = TypedDict('CellPairStatement', {
    'distance_mm': 'list[float]',
    'first': 'str',
    'first_mm': 'list[float]',
    'off_mm': 'NotRequired[list[float] | None]',
    'second': 'NotRequired[str | None]',
    'second_mm': 'list[float]',
})

CellPlace = TypedDict('CellPlace', {'address': 'str', 'centre_mm': 'list[float]', 'radius_mm': 'float', 'state': 'str'})

Certificate = TypedDict('Certificate', {
    'achieved_bound_mm': 'float',
    'area_mm2': 'NotRequired[list[float]]',
    'bbox_mm': 'list[list[list[float]]]',
    'boundary_edges': 'NotRequired[int | None]',
    'boundary_loops': 'NotRequired[int | None]',
    'cavities': 'NotRequired[int | None]',
    'centroid_mm': 'NotRequired[list[list[float]]]',
    'closing': 'NotRequired[ClosingStatement | None]',
    'components': 'NotRequired[int | None]',
    'contact': 'NotRequired[ContactStatement | None]',
    'degenerate_triangles': 'NotRequired[int | None]',
    'dimension': 'NotRequired[DimensionStatement | None]',
    'edges': 'int',
    'enclosed': 'NotRequired[EnclosedStatement | None]',
    'euler': 'NotRequired[int | None]',
    'extent': 'NotRequired[ExtentStatement | None]',
    'flipped_pairs': 'NotRequired[int | None]',
    'genus': 'NotRequired[int | None]',
    'hausdorff': 'NotRequired[HausdorffStatement | None]',
    'inertia_mm5': 'NotRequired[list[list[list[float]]]]',
    'inner_bound_mm': 'NotRequired[float | None]',
    'input_digest': 'str',
    'kernel_version': 'str',
    'lattice_pitch_mm': 'NotRequired[float | None]',
    'leaf_cells': 'int',
    'level': 'NotRequired[LevelStatement | None]',
    'mass_g': 'NotRequired[list[float]]',
    'mesh_area_mm2': 'NotRequired[float | None]',
    'mesh_volume_mm3': 'NotRequired[float | None]',
    'nonmanifold_edges': 'NotRequired[int | None]',
    'nonmanifold_vertices': 'NotRequired[int | None]',
    'operation': 'NotRequired[OperationStatement | None]',
    'oriented_box': 'NotRequired[OrientedBoxStatement | None]',
    'outer_bound_mm': 'NotRequired[float | None]',
    'output_digests': 'dict[str, str]',
    'preview': 'NotRequired[PreviewStatement | None]',
    'repair': 'NotRequired[list[RepairStatement]]',
    'requested_tolerance_mm': 'float',
    'sections': 'NotRequired[SectionsStatement | None]',
    'self_intersections': "Literal['none', 'not_checked'] | int",
    'shells': 'NotRequired[int | None]',
    'split': 'NotRequired[SplitStatement | None]',
    'stability': 'NotRequired[StabilityStatement | None]',
    'thickness': 'NotRequired[ThicknessStatement | None]',
    'thickness_min_mm': 'NotRequired[float | None]',
    'topology_exact': "NotRequired[Literal['not_checked'] | bool]",
    'topology_stable': "Literal['not_checked'] | bool",
    'triangles': 'int',
    'vertices': 'int',
    'volume_mm3': 'NotRequired[list[float]]',
    'wall': 'NotRequired[WallStatement | None]',
    'warnings': 'list[str]',
})

ClassicView = TypedDict('ClassicView', {'name': 'str', 'source': 'str', 'title': 'str'})

ClosingStatement = TypedDict('ClosingStatement', {'ball_radius_mm': 'float', 'width_mm': 'float'})

Coefficients = TypedDict('Coefficients', {'faces': 'NotRequired[list[int]]', 'weights': 'list[list[float]]'})

ContactStatement = TypedDict('ContactStatement', {
    'complete': 'bool',
    'distance_mm': 'list[float]',
    'inside': 'NotRequired[InsideStatement | None]',
    'nearest': 'CellPairStatement',
    'pairs_looked_at': 'int',
    'places': 'list[PlaceStatement]',
    'verdict': 'ContactVerdict',
})

ContactVerdict: TypeAlias = Literal['disjoint', 'near', 'touching']

ControlMesh = TypedDict('ControlMesh', {'faces': 'list[list[int]]', 'vertices': 'list[list[float]]'})

ControlPoint: TypeAlias = list[float]

CopiedPrimitive: TypeAlias = Literal['stated', 'box']

Corner = TypedDict('Corner', {'sharpness': "float | Literal['infinite']", 'vertex': 'int'})

CornerCuttingScheme = TypedDict('CornerCuttingScheme', {
    'a': 'NotRequired[float]',
    'b': 'NotRequired[float]',
    'closed': 'NotRequired[bool]',
    'family': "Literal['corner_cutting']",
})

CornerCuttingShape = TypedDict('CornerCuttingShape', {
    'a': 'NotRequired[float]',
    'b': 'NotRequired[float]',
    'closed': 'NotRequired[bool]',
    'control_points': 'list[list[float]]',
    'family': "Literal['corner_cutting']",
})

CountedPoint = TypedDict('CountedPoint', {'point_mm': 'list[float]', 'times': 'int'})

Counts = TypedDict('Counts', {
    'cancelled': 'int',
    'expired': 'int',
    'failed': 'int',
    'queued': 'int',
    'running': 'int',
    'succeeded': 'int',
})

Crease = TypedDict('Crease', {'edge': 'list[int]', 'sharpness': "float | Literal['infinite']"})

CriticalRadiusStatement = TypedDict('CriticalRadiusStatement', {
    'change': 'TopologyChange',
    'euler': 'NotRequired[int | None]',
    'places': 'int',
    'proven': 'bool',
    'radius_mm': 'list[float]',
})

CurveScheme: TypeAlias = 'BezierScheme | NurbsScheme | CatmullRomScheme | BetaSplineScheme | CornerCuttingScheme | FourPointScheme | InterpolationScheme | BcifsScheme | IfsScheme'

CurveShape: TypeAlias = 'BezierCurveShape | NurbsCurveShape | CatmullRomShape | BetaSplineShape | CornerCuttingShape | FourPointShape | InterpolationShape'

DeterminedParameter = TypedDict('DeterminedParameter', {'name': 'str', 'stated': 'float', 'value': 'float'})

DimensionBasis: TypeAlias = Literal['elementary', 'similarities', 'overlapping_similarities', 'contraction']

DimensionStatement = TypedDict('DimensionStatement', {'basis': 'DimensionBasis', 'bounds': 'list[float]'})

DirectedStatement = TypedDict('DirectedStatement', {'distance_mm': 'list[float]', 'near_mm': 'list[float]'})

EmbeddedModel = TypedDict('EmbeddedModel', {
    'lacuna': 'NotRequired[Literal[1]]',
    'name': 'NotRequired[str]',
    'shape': 'Shape',
    'units': "NotRequired[Literal['um', 'mm', 'cm', 'm', 'in']]",
})

EnclosedStatement = TypedDict('EnclosedStatement', {
    'counted_once_beyond_mm': 'NotRequired[float | None]',
    'counted_otherwise': 'NotRequired[CountedPoint | None]',
    'method': 'VolumeMethod',
    'volume_mm3': 'list[float]',
})

ExactNumber = TypedDict('ExactNumber', {'exact': 'str', 'value': 'float'})

Excess = TypedDict('Excess', {'allowed': 'float', 'asked': 'float', 'limit': 'str', 'remedy': 'dict[str, float]'})

ExtentStatement = TypedDict('ExtentStatement', {
    'direction': 'list[float]',
    'from_mm': 'list[float]',
    'to_mm': 'list[float]',
    'width_mm': 'list[float]',
})

Figures = TypedDict('Figures', {
    'achieved_bound_mm': 'float',
    'components': 'NotRequired[int | None]',
    'genus': 'NotRequired[int | None]',
    'mesh_area_mm2': 'NotRequired[float | None]',
    'mesh_volume_mm3': 'NotRequired[float | None]',
    'requested_tolerance_mm': 'float',
    'thickness_min_mm': 'NotRequired[float | None]',
    'triangles': 'int',
})

Finding = TypedDict('Finding', {
    'code': 'str',
    'column': 'NotRequired[int | None]',
    'line': 'NotRequired[int | None]',
    'message': 'str',
    'pointer': 'str',
})

FormatCapability = TypedDict('FormatCapability', {
    'carries': 'list[str]',
    'media_type': 'str',
    'name': 'str',
    'reads': 'bool',
})

FourPointScheme = TypedDict('FourPointScheme', {
    'closed': 'NotRequired[bool]',
    'family': "Literal['four_point']",
    'w': 'NotRequired[float]',
})

FourPointShape = TypedDict('FourPointShape', {
    'closed': 'NotRequired[bool]',
    'control_points': 'list[list[float]]',
    'family': "Literal['four_point']",
    'w': 'NotRequired[float]',
})

FreeParameter = TypedDict('FreeParameter', {'declared': 'bool', 'name': 'str', 'pointer': 'str', 'value': 'float'})

Glue = TypedDict('Glue', {
    'between': 'list[list[int]]',
    'permutation': 'NotRequired[list[int]]',
    'reversed': 'NotRequired[bool]',
})

GroupShape = TypedDict('GroupShape', {
    'family': "Literal['group']",
    'joins': 'NotRequired[list[Join]]',
    'parts': 'list[Part]',
})

HausdorffStatement = TypedDict('HausdorffStatement', {
    'complete': 'bool',
    'distance_mm': 'list[float]',
    'from_first': 'DirectedStatement',
    'from_second': 'DirectedStatement',
})

Health = TypedDict('Health', {'status': 'str'})

Holder: TypeAlias = Literal['first', 'second']

IfsScheme = TypedDict('IfsScheme', {'family': "Literal['ifs']", 'maps': 'list[AffineMap]'})

IfsShape = TypedDict('IfsShape', {
    'family': "Literal['ifs']",
    'graph': 'NotRequired[list[list[int]] | list[list[bool]]]',
    'maps': 'list[AffineMap]',
    'primitive': 'NotRequired[Primitive]',
})

Incidence = TypedDict('Incidence', {'boundary': 'int', 'children': 'list[list[int]]', 'state': 'str'})

InsideStatement = TypedDict('InsideStatement', {
    'holder': 'Holder',
    'point_mm': 'list[float]',
    'surface_distance_mm': 'list[float]',
})

InterpolationScheme = TypedDict('InterpolationScheme', {
    'family': "Literal['interpolation']",
    'vertical_scaling': 'list[float]',
})

InterpolationShape = TypedDict('InterpolationShape', {
    'family': "Literal['interpolation']",
    'maps': 'NotRequired[list[AffineMap]]',
    'points': 'list[list[float]]',
    'vertical_scaling': 'NotRequired[list[float]]',
})

Job = TypedDict('Job', {
    'inputs': 'NotRequired[list[JobInput]]',
    'kind': "Literal['evaluate', 'solidify', 'measure', 'intersect', 'slice', 'convert']",
    'lacuna': 'Literal[1]',
    'limits': 'NotRequired[JobLimits]',
    'model': 'NotRequired[EmbeddedModel]',
    'model_ref': 'NotRequired[str]',
    'outputs': "NotRequired[list[Literal['stl', '3mf', 'glb', 'obj', 'ply', 'off', 'wrl', 'png', 'csv', 'svg', 'dxf']]]",
    'params': 'JobParams',
    'supersedes': 'NotRequired[str]',
})

JobInput = TypedDict('JobInput', {
    'model': 'NotRequired[EmbeddedModel]',
    'model_ref': 'NotRequired[str]',
    'name': 'str',
    'radius_mm': 'NotRequired[float]',
})

JobKind: TypeAlias = Literal['evaluate', 'solidify', 'measure', 'intersect', 'slice', 'convert']

JobLimits = TypedDict('JobLimits', {
    'cells': 'NotRequired[int]',
    'depth': 'NotRequired[int]',
    'memory_bytes': 'NotRequired[int]',
    'output_bytes': 'NotRequired[int]',
    'seconds': 'NotRequired[float]',
    'triangles': 'NotRequired[int]',
})

JobPage = TypedDict('JobPage', {'items': 'list[JobView]', 'next': 'NotRequired[str | None]'})

JobParams = TypedDict('JobParams', {
    'clearance_mm': 'NotRequired[float]',
    'closing_mm': 'NotRequired[float]',
    'cuts_mm': 'NotRequired[list[list[float]]]',
    'density_g_cm3': 'NotRequired[float]',
    'direction': 'NotRequired[list[float]]',
    'key_mm': 'NotRequired[float]',
    'level': 'NotRequired[int]',
    'normal': 'NotRequired[list[float]]',
    'normals': 'NotRequired[bool]',
    'offsets_mm': 'NotRequired[list[float]]',
    'operation': "NotRequired[Literal['union', 'intersection', 'difference', 'hull', 'trim', 'split']]",
    'oriented_box': 'NotRequired[bool]',
    'plane': 'NotRequired[list[float]]',
    'preview': 'NotRequired[bool]',
    'radius_mm': 'NotRequired[float]',
    'repair': 'NotRequired[bool]',
    'side': "NotRequired[Literal['inward', 'outward']]",
    'simplify': 'NotRequired[bool]',
    'stability': 'NotRequired[bool]',
    'step_mm': 'NotRequired[float]',
    'thickness': 'NotRequired[bool]',
    'tolerance_mm': 'NotRequired[float]',
    'volume_mm': 'NotRequired[list[float]]',
    'wall_mm': 'NotRequired[float]',
    'with': 'NotRequired[With]',
})

JobState: TypeAlias = Literal['queued', 'running', 'cancelling', 'succeeded', 'failed', 'cancelled', 'expired']

JobView = TypedDict('JobView', {
    'attempt': 'int',
    'batch': 'NotRequired[str | None]',
    'certificate': 'NotRequired[Certificate | None]',
    'created': 'str',
    'expired': 'NotRequired[str | None]',
    'finished': 'NotRequired[str | None]',
    'handed_back': 'NotRequired[int]',
    'id': 'str',
    'input_digest': 'str',
    'kind': 'JobKind',
    'outputs': 'list[Output]',
    'problem': 'NotRequired[Problem | None]',
    'progress': 'NotRequired[Step | None]',
    'reused': 'bool',
    'started': 'NotRequired[str | None]',
    'state': 'JobState',
    'warnings': 'list[str]',
})

Join = TypedDict('Join', {'between': 'list[Border]', 'strip': 'NotRequired[bool]'})

Kind: TypeAlias = Literal['sourced', 'chosen']

LeastThicknessStatement = TypedDict('LeastThicknessStatement', {
    'between_mm': 'list[list[float]]',
    'least_mm': 'list[float]',
})

LevelStatement = TypedDict('LevelStatement', {
    'cancelled_faces': 'int',
    'copies': 'float',
    'doubled_vertices': 'int',
    'level': 'int',
    'primitive': 'CopiedPrimitive',
})

LibraryPage = TypedDict('LibraryPage', {'items': 'list[ClassicView]'})

LimitCapability = TypedDict('LimitCapability', {
    'batch_jobs': 'int',
    'body_bytes': 'int',
    'calls_per_minute': 'int',
    'cells': 'int',
    'depth': 'int',
    'expired_hours': 'int',
    'jobs_per_key': 'int',
    'memory_bytes': 'int',
    'output_bytes': 'int',
    'queued_jobs': 'int',
    'retention_hours': 'int',
    'seconds': 'float',
    'stored_bytes': 'int',
    'submissions_per_minute': 'int',
    'triangles': 'int',
    'upload_bytes': 'int',
    'wait_seconds': 'int',
})

LocalSolution = TypedDict('LocalSolution', {'equations': 'int', 'rank': 'int', 'starts': 'int', 'unknowns': 'int'})

LocatedPoint = TypedDict('LocatedPoint', {
    'address': 'str',
    'bound_mm': 'float',
    'cell': 'CellPlace',
    'point_mm': 'list[float]',
})

Material = TypedDict('Material', {
    'density_g_cm3': 'float',
    'name': 'str',
    'range_g_cm3': 'NotRequired[list[float] | None]',
    'source': 'str',
    'title': 'str',
})

MaterialPage = TypedDict('MaterialPage', {'items': 'list[Material]'})

Matrix: TypeAlias = list[list[float | None | str]]

MeshData = TypedDict('MeshData', {'faces': 'list[list[int]]', 'vertices': 'list[list[float]]'})

MeshFile: TypeAlias = str

MeshReport = TypedDict('MeshReport', {
    'area_mm2': 'NotRequired[float | None]',
    'bbox_mm': 'NotRequired[list[list[float]] | None]',
    'boundary_edges': 'int',
    'bytes': 'int',
    'cage': 'Cage',
    'cavities': 'int',
    'closed_manifold': 'bool',
    'components': 'int',
    'degenerate_triangles': 'int',
    'edges': 'int',
    'encoding': 'str',
    'euler': 'int',
    'flipped_pairs': 'int',
    'format': 'str',
    'genus': 'NotRequired[int | None]',
    'left_out': 'dict[str, int]',
    'nonmanifold_edges': 'int',
    'nonmanifold_vertices': 'int',
    'objects': 'list[str]',
    'points': 'NotRequired[int]',
    'polygons_fanned': 'int',
    'prompts': 'list[Prompt]',
    'segments': 'NotRequired[int]',
    'shells': 'int',
    'triangles': 'int',
    'unit': 'str',
    'vertices': 'int',
    'volume_mm3': 'NotRequired[float | None]',
})

MeshShape = TypedDict('MeshShape', {
    'faces': 'NotRequired[list[list[int]]]',
    'family': "Literal['mesh']",
    'file': 'NotRequired[str]',
    'interior': "NotRequired[Literal['auto', 'solid', 'surface']]",
    'vertices': 'NotRequired[list[list[float]]]',
})

Model = TypedDict('Model', {
    'lacuna': 'Literal[1]',
    'name': 'NotRequired[str]',
    'shape': 'Shape',
    'units': "NotRequired[Literal['um', 'mm', 'cm', 'm', 'in']]",
})

ModelPage = TypedDict('ModelPage', {'items': 'list[ModelView]', 'next': 'NotRequired[str | None]'})

ModelView = TypedDict('ModelView', {
    'bytes': 'int',
    'created': 'str',
    'digest': 'str',
    'id': 'str',
    'mesh': 'NotRequired[MeshReport | None]',
    'name': 'NotRequired[str | None]',
})

NearbyCell: TypeAlias = Any

NearbyCells = TypedDict('NearbyCells', {
    'cells': 'list[NearbyCell]',
    'complete': 'bool',
    'nearest': 'NearestPoint',
    'point_mm': 'list[float]',
    'tolerance_mm': 'float',
    'within_mm': 'NotRequired[float | None]',
})

NearestPoint = TypedDict('NearestPoint', {
    'address': 'str',
    'bound_mm': 'float',
    'distance_mm': 'list[float]',
    'point_mm': 'list[float]',
})

NurbsCurveShape = TypedDict('NurbsCurveShape', {
    'control_points': 'list[ControlPoint]',
    'degree': 'int',
    'family': "Literal['nurbs_curve']",
    'knots': 'list[float]',
    'weights': 'NotRequired[list[float]]',
})

NurbsScheme = TypedDict('NurbsScheme', {'degree': 'int', 'family': "Literal['nurbs_curve']", 'knots': 'list[float]'})

NurbsSurfaceShape = TypedDict('NurbsSurfaceShape', {
    'control_points': 'list[list[ControlPoint]]',
    'degree': 'int | list[int]',
    'family': "Literal['nurbs_surface']",
    'knots': 'list[list[float]]',
    'trim': 'NotRequired[Trim]',
    'weights': 'NotRequired[list[list[float]]]',
})

NurbsVolumeShape = TypedDict('NurbsVolumeShape', {
    'control_points': 'list[list[list[ControlPoint]]]',
    'degree': 'int | list[int]',
    'family': "Literal['nurbs_volume']",
    'knots': 'list[list[float]]',
    'weights': 'NotRequired[list[list[list[float]]]]',
})

OperandStatement = TypedDict('OperandStatement', {
    'inner_bound_mm': 'float',
    'mesh_volume_mm3': 'float',
    'name': 'str',
    'outer_bound_mm': 'float',
    'radius_mm': 'float',
    'triangles': 'int',
})

Operation: TypeAlias = Literal['union', 'intersection', 'difference', 'hull', 'trim', 'split']

OperationStatement = TypedDict('OperationStatement', {
    'engine': 'str',
    'operands': 'list[OperandStatement]',
    'operation': 'Operation',
})

OrientedBoxStatement = TypedDict('OrientedBoxStatement', {
    'axes': 'list[list[float]]',
    'centre_mm': 'list[float]',
    'complete': 'bool',
    'sizes_mm': 'list[float]',
    'volume_mm3': 'list[float]',
})

Output = TypedDict('Output', {'bytes': 'int', 'digest': 'str', 'file_name': 'str', 'media_type': 'str', 'name': 'str'})

Part: TypeAlias = Any

PartStatement = TypedDict('PartStatement', {
    'bbox_mm': 'list[list[float]]',
    'components': 'int',
    'mesh_volume_mm3': 'float',
    'moved_mm': 'list[float]',
    'name': 'str',
    'pegs': 'int',
    'sockets': 'int',
    'triangles': 'int',
})

PlaceStatement = TypedDict('PlaceStatement', {
    'bbox_mm': 'list[list[float]]',
    'distance_mm': 'list[float]',
    'nearest': 'CellPairStatement',
    'pairs': 'int',
    'verdict': 'ContactVerdict',
})

Plan = TypedDict('Plan', {
    'counted_cells': 'NotRequired[float]',
    'counted_triangles': 'NotRequired[float]',
    'cpu_seconds': 'NotRequired[float | None]',
    'exceeds': 'NotRequired[Excess | None]',
    'lattice_pitch_mm': 'NotRequired[float | None]',
    'leaf_cells': 'float',
    'memory_bytes': 'float',
    'output_bytes': 'NotRequired[float | None]',
    'smallest_feature_mm': 'NotRequired[float | None]',
    'triangles': 'float',
})

PlaneStatement = TypedDict('PlaneStatement', {
    'area_mm2': 'float',
    'holes': 'int',
    'offset_mm': 'float',
    'perimeter_mm': 'float',
    'polygons': 'int',
})

PreviewStatement = TypedDict('PreviewStatement', {
    'final_tolerance_mm': 'float',
    'tolerance_mm': 'float',
    'without_ball': 'bool',
})

Primitive = TypedDict('Primitive', {
    'closed': 'NotRequired[bool]',
    'mesh': 'NotRequired[MeshData]',
    'points': 'NotRequired[list[list[float]]]',
    'polyline': 'NotRequired[list[list[float]]]',
    'solid': 'NotRequired[MeshData]',
})

Problem = TypedDict('Problem', {
    'allowed': 'NotRequired[float | None]',
    'asked': 'NotRequired[float | None]',
    'code': 'str',
    'detail': 'str',
    'errors': 'NotRequired[list[Finding]]',
    'limit': 'NotRequired[str | None]',
    'remedy': 'NotRequired[dict[str, float] | None]',
    'request_id': 'NotRequired[str | None]',
    'retry_after': 'NotRequired[int | None]',
    'status': 'int',
    'title': 'str',
    'type': 'ProblemKind',
})

ProblemKind: TypeAlias = Literal['/problems/malformed-json', '/problems/bad-request', '/problems/unauthenticated', '/problems/forbidden', '/problems/not-found', '/problems/method-not-allowed', '/problems/not-acceptable', '/problems/request-timeout', '/problems/idempotency-in-progress', '/problems/state-conflict', '/problems/result-expired', '/problems/body-too-large', '/problems/unsupported-media', '/problems/range', '/problems/invalid-model', '/problems/invalid-file', '/problems/idempotency-mismatch', '/problems/precondition-failed', '/problems/unreachable', '/problems/limit', '/problems/too-many-jobs', '/problems/rate-limited', '/problems/cancelled', '/problems/interrupted', '/problems/internal', '/problems/input-output', '/problems/unavailable', '/problems/misdirected', '/problems/shutting-down', '/problems/timeout', '/problems/usage', '/problems/check-failed', '/problems/service-unreachable']

ProblemPage = TypedDict('ProblemPage', {'exit_code': 'int', 'status': 'int', 'title': 'str', 'type': 'ProblemKind'})

Profile = TypedDict('Profile', {'name': 'str', 'quantities': 'list[Quantity]', 'title': 'str'})

ProfilePage = TypedDict('ProfilePage', {'items': 'list[Profile]'})

Prompt = TypedDict('Prompt', {'code': 'str', 'message': 'str'})

Quantity = TypedDict('Quantity', {
    'kind': 'Kind',
    'max': 'NotRequired[float | None]',
    'min': 'NotRequired[float | None]',
    'name': 'str',
    'remark': 'NotRequired[str]',
    'source': 'str',
    'unit': 'str',
    'value': 'float',
})

RadiusByLevel = TypedDict('RadiusByLevel', {'first_mm': 'float', 'least_mm': 'float', 'ratio': 'float'})

Relation = TypedDict('Relation', {'equal': 'list[Side]', 'state': 'str'})

Remark = TypedDict('Remark', {
    'code': 'str',
    'column': 'NotRequired[int | None]',
    'line': 'NotRequired[int | None]',
    'message': 'str',
    'pointer': 'str',
    'severity': 'Severity',
})

RepairStatement = TypedDict('RepairStatement', {
    'changed': 'bool',
    'closed_holes': 'int',
    'closing_triangles': 'int',
    'crossings': 'int',
    'doubled_vertices': 'int',
    'input': 'str',
    'joined_vertices': 'int',
    'longest_hole_edges': 'int',
    'parted_edges': 'int',
    'removed_copies': 'int',
    'removed_flat_triangles': 'int',
    'shells_made_voids': 'int',
    'turned_triangles': 'int',
})

RootCell = TypedDict('RootCell', {'control_points': 'list[ControlPoint | None]', 'state': 'str'})

SectionsStatement = TypedDict('SectionsStatement', {
    'normal': 'list[float]',
    'planes': 'list[PlaneStatement]',
    'u': 'list[float]',
    'v': 'list[float]',
})

Severity: TypeAlias = Literal['error', 'warning']

Shape: TypeAlias = 'IfsShape | BcifsShape | BezierCurveShape | CornerCuttingShape | SubdivisionShape | BezierSurfaceShape | NurbsCurveShape | NurbsSurfaceShape | NurbsVolumeShape | CatmullRomShape | BetaSplineShape | FourPointShape | InterpolationShape | TensorShape | SumShape | MeshShape | TerrainShape | GroupShape'

ShortOrder = TypedDict('ShortOrder', {
    'inputs': 'NotRequired[list[JobInput]]',
    'lacuna': 'Literal[1]',
    'limits': 'NotRequired[JobLimits]',
    'model': 'NotRequired[EmbeddedModel]',
    'model_ref': 'NotRequired[str]',
    'outputs': "NotRequired[list[Literal['stl', '3mf', 'glb', 'obj', 'ply', 'off', 'wrl', 'png', 'csv', 'svg', 'dxf']]]",
    'params': 'JobParams',
    'supersedes': 'NotRequired[str]',
})

Side = TypedDict('Side', {'boundary': 'NotRequired[list[int]]', 'path': 'NotRequired[list[int]]'})

SolutionMethod: TypeAlias = Literal['exact', 'local']

SolutionSpace = TypedDict('SolutionSpace', {
    'degrees_of_freedom': 'int',
    'determined': 'list[DeterminedParameter]',
    'entries': 'list[SolvedEntry]',
    'local': 'NotRequired[LocalSolution | None]',
    'method': 'SolutionMethod',
    'parameters': 'list[FreeParameter]',
    'residual': 'float',
    'spectral_radius': 'NotRequired[list[float | None] | None]',
})

SolveReport: TypeAlias = Any

SolveRequest = TypedDict('SolveRequest', {
    'lacuna': 'NotRequired[Literal[1]]',
    'model': 'NotRequired[EmbeddedModel]',
    'model_ref': 'NotRequired[str]',
    'values': 'NotRequired[dict[str, float]]',
})

SolvedEntry = TypedDict('SolvedEntry', {
    'coefficients': 'NotRequired[dict[str, ExactNumber] | None]',
    'constant': 'NotRequired[ExactNumber | None]',
    'name': 'str',
    'pointer': 'str',
    'value': 'float',
})

SplitStatement = TypedDict('SplitStatement', {
    'cuts_mm': 'list[list[float]]',
    'keys': 'int',
    'parts': 'list[PartStatement]',
    'peg_volume_mm3': 'float',
    'socket_volume_mm3': 'float',
    'volume_mm': 'NotRequired[list[float] | None]',
    'whole_volume_mm3': 'float',
})

StabilityStatement = TypedDict('StabilityStatement', {
    'above': 'NotRequired[CriticalRadiusStatement | None]',
    'below': 'NotRequired[CriticalRadiusStatement | None]',
    'critical': 'list[CriticalRadiusStatement]',
    'examined_mm': 'list[float]',
    'one_piece_mm': 'list[float]',
})

State = TypedDict('State', {
    'boundaries': 'NotRequired[list[Boundary]]',
    'cell': "Literal['vertex', 'edge', 'face', 'volume']",
    'dimension': 'int',
    'name': 'str',
    'transitions': 'list[Transition]',
})

Step = TypedDict('Step', {'bound_mm': 'NotRequired[float | None]', 'count': 'int', 'fraction': 'float', 'phase': 'str'})

SubdivisionShape = TypedDict('SubdivisionShape', {
    'boundary': "NotRequired[Literal['smooth', 'sharp_corners']]",
    'coefficients': 'NotRequired[list[Coefficients]]',
    'corners': 'NotRequired[list[Corner]]',
    'creases': 'NotRequired[list[Crease]]',
    'family': "Literal['subdivision']",
    'mesh': 'ControlMesh',
    'scheme': "Literal['catmull_clark', 'doo_sabin', 'loop']",
})

SumShape = TypedDict('SumShape', {'family': "Literal['sum']", 'u': 'CurveShape', 'v': 'CurveShape'})

TensorShape = TypedDict('TensorShape', {
    'control_points': 'list[list[ControlPoint]] | list[list[list[ControlPoint]]]',
    'family': "Literal['tensor']",
    'u': 'CurveScheme',
    'v': 'CurveScheme',
    'w': 'NotRequired[CurveScheme]',
    'weights': 'NotRequired[list[list[float]] | list[list[list[float]]]]',
})

TerrainShape = TypedDict('TerrainShape', {
    'family': "Literal['terrain']",
    'grid': 'NotRequired[list[list[list[float]]]]',
    'levels': 'int',
    'random_seed': 'NotRequired[int]',
    'roughness': 'float',
    'triangle': 'NotRequired[list[list[float]]]',
})

ThicknessStatement = TypedDict('ThicknessStatement', {
    'gap': 'NotRequired[LeastThicknessStatement | None]',
    'wall': 'NotRequired[LeastThicknessStatement | None]',
})

TopologyChange: TypeAlias = Literal['joins', 'closes', 'fills', 'unclear']

Transition = TypedDict('Transition', {'operator': 'Matrix', 'to': 'str'})

Trim = TypedDict('Trim', {'inner': 'NotRequired[list[list[TrimCurve]]]', 'outer': 'NotRequired[list[TrimCurve]]'})

TrimBezier = TypedDict('TrimBezier', {
    'control_points': 'list[TrimPoint]',
    'family': "Literal['bezier_curve']",
    'weights': 'NotRequired[list[float]]',
})

TrimCurve: TypeAlias = 'TrimPolyline | TrimBezier | TrimNurbs'

TrimNurbs = TypedDict('TrimNurbs', {
    'control_points': 'list[TrimPoint]',
    'degree': 'int',
    'family': "Literal['nurbs_curve']",
    'knots': 'list[float]',
    'weights': 'NotRequired[list[float]]',
})

TrimPoint: TypeAlias = list[float]

TrimPolyline = TypedDict('TrimPolyline', {'family': "Literal['polyline']", 'points': 'list[list[float]]'})

ValidationReport = TypedDict('ValidationReport', {
    'constraint_residual': 'NotRequired[float | None]',
    'degrees_of_freedom': 'NotRequired[int | None]',
    'diagnostics': 'list[Remark]',
    'spectral_radius': 'NotRequired[list[float | None] | None]',
    'states': 'NotRequired[int | None]',
    'valid': 'bool',
})

Version = TypedDict('Version', {'api': 'str', 'name': 'str', 'version': 'str'})

VolumeMethod: TypeAlias = Literal['trilinear_forms']

WallSide: TypeAlias = Literal['inward', 'outward']

WallStatement = TypedDict('WallStatement', {
    'hollow_volume_mm3': 'NotRequired[float | None]',
    'reached_mm': 'list[float]',
    'side': 'WallSide',
    'solid_volume_mm3': 'float',
    'thickness_mm': 'float',
})

With = TypedDict('With', {
    'ball': 'NotRequired[list[float]]',
    'box': 'NotRequired[list[float]]',
    'line': 'NotRequired[list[float]]',
    'plane': 'NotRequired[list[float]]',
    'point': 'NotRequired[list[float]]',
    'ray': 'NotRequired[list[float]]',
    'segment': 'NotRequired[list[float]]',
    'self': 'NotRequired[Literal[True]]',
})
