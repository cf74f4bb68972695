// Generated from api/openapi.json by api/clients/generate.py: do not edit.

/** The answer to a question about addresses: the member of what was asked. */
export interface AddressAnswer {
  at?: LocatedPoint | null;
  near?: NearbyCells | null;
}

/**
 * Where an address leads (at), or which addresses lead near a point (near). Exactly one of model and model_ref
 * is given, and exactly one of at and near.
 */
export interface AddressQuestion {
  /** An address: the root cell, a colon, the indices of transitions, and in parentheses those that repeat without end, for example `0: 1 2 (0 3)`. */ at?: string;
  /** The version of the grammar: 1. */ lacuna?: 1;
  /** The model, in full. */ model?: EmbeddedModel;
  /** The id of a stored model or of an uploaded mesh file. */ model_ref?: string;
  /** With `near`: cells to list at most. */ most?: number;
  /** A point, in mm whatever the unit of the model. */ near?: Array<number>;
  /** With `near`: radius to which cells are refined; a thousandth of the shape's when absent. */ tolerance_mm?: number;
  /** With `near`: cells as far as this are listed; those that may hold the closest point of the shape when absent. */ within_mm?: number;
}

/** Two children share a boundary. */
export interface Adjacency {
  /** Two pairs [child, boundary of that child]. */ between: Array<Array<number>>;
  /** The order in which the second's control points are taken: the k-th of the first is number permutation[k] of the second. Excludes reversed. */ permutation?: Array<number>;
  /** Whether the second is seen from its other end. */ reversed?: boolean;
  /** Name of the state. */ state: string;
}

/** An affine map of space. */
export type AffineMap = unknown;

/**
 * Several jobs that are accepted together, or not at all, and done in any order; each ends for itself, well or
 * not.
 */
export interface Batch {
  /** The jobs. */ jobs: Array<BatchEntry>;
  /** The version of the grammar: 1. */ lacuna: 1;
}

/** What is proven of all results of a batch: the parent of its jobs' certificates. */
export interface BatchCertificate {
  /** The batch's id, where a service did it. */ batch?: string | null;
  /** How many of its jobs ended how. */ counts: Counts;
  /** `sha256:` digest of the jobs' input digests in their order, each with a line end. */ input_digest: string;
  /** The jobs, in the order of the batch's document. */ jobs: Array<BatchRow>;
  /** The version that did it. */ kernel_version: string;
  /** How it ended. */ state: BatchState;
}

/** A job document, and what the batch calls it. */
export interface BatchEntry {
  /** The job document, without supersedes. */ job: Job;
  /** What to call it; no two jobs of a batch are called the same. */ name?: string;
}

/** A job of a batch: what it is called, where it stands, and what came of it. */
export interface BatchRow {
  figures?: Figures | null;
  /** Its place in the batch's document, from 0. */ index: number;
  /** `sha256:` digest of its canonical document. */ input_digest: string;
  /** The job's id, where a service did it: all of it is at `/v1/jobs/{id}`. */ job?: string | null;
  /** What it does. */ kind: JobKind;
  /** What the batch calls it. */ name?: string | null;
  /** Digests of the files that it made, by their names; that of `certificate.json` is among them. */ output_digests?: Record<string, string>;
  problem?: Problem | null;
  progress?: Step | null;
  /** Where it stands. */ state: JobState;
  /** What the owner should know, in words. */ warnings?: Array<string>;
}

/** Where a batch stands. */
export type BatchState = "queued" | "running" | "succeeded" | "partly_succeeded" | "failed" | "cancelled" | "expired";

/** A batch as its owner sees it. */
export interface BatchView {
  /** How many jobs stand where. */ counts: Counts;
  /** When it was accepted. */ created: string;
  /** When the last of its jobs ended. */ finished?: string | null;
  /** Share of the jobs that have ended, in [0, 1]. */ fraction: number;
  /** Its id. */ id: string;
  /** The jobs, in the order of the batch's document. */ jobs: Array<BatchRow>;
  /** Where it stands. */ state: BatchState;
}

/** A curve of one's own states: edges between two vertices. As many control points as the first state has. */
export interface BcifsScheme {
  /** The family of the shape. */ family: "bcifs";
  /** The name of the curve's state; the first when absent. */ start?: string;
  /** The kinds of cells: the curve's, those that it reaches, and their vertices. */ states: Array<State>;
}

/**
 * A boundary controlled iterated function system, stated in full: states, operators, boundaries, constraints and
 * root cells.
 */
export interface BcifsShape {
  /** Adjacency constraints: boundaries that two children share. */ adjacencies?: Array<Adjacency>;
  /** The root cells. */ cells: Array<RootCell>;
  /** The family of the shape. */ family: "bcifs";
  /** Boundaries of root cells that are one; as objects or as bare pairs. */ glue?: Array<Glue | Array<Array<number>>>;
  /** Incidence constraints: how a boundary's subdivision lies in the subdivision. */ incidences?: Array<Incidence>;
  /** Named values that entries of matrices may use. */ parameters?: Record<string, number>;
  /** Further equations between products of operators and embeddings. */ relations?: Array<Relation>;
  /** The kinds of cells. */ states: Array<State>;
}

/** A uniformly shaped beta-spline. */
export interface BetaSplineScheme {
  /** Bias, above zero; 1, no bias, when absent. */ beta1?: number;
  /** Tension; 0, none, when absent. */ beta2?: number;
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The family of the shape. */ family: "beta_spline";
}

/** A uniformly shaped cubic beta-spline (Barsky); beta1 = 1 and beta2 = 0 make the uniform B-spline. */
export interface BetaSplineShape {
  /** Bias, above zero; 1, no bias, when absent. */ beta1?: number;
  /** Tension; 0, none, when absent. */ beta2?: number;
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The control polygon. */ control_points: Array<Array<number>>;
  /** The family of the shape. */ family: "beta_spline";
}

/** A polynomial or rational Bezier curve; n control points make degree n - 1. */
export interface BezierCurveShape {
  /** The control points, in order. */ control_points: Array<ControlPoint>;
  /** The family of the shape. */ family: "bezier_curve";
  /** One positive weight per control point, unless the points carry theirs. */ weights?: Array<number>;
}

/** A Bezier curve of as many points as the net has in this direction. */
export interface BezierScheme {
  /** The family of the shape. */ family: "bezier_curve";
}

/** A polynomial or rational Bezier patch. */
export interface BezierSurfaceShape {
  /** control_points[i][j], i along the first direction. */ control_points: Array<Array<ControlPoint>>;
  /** The family of the shape. */ family: "bezier_surface";
  /** Loops that cut the surface in its parameter plane; the whole surface when absent. */ trim?: Trim;
  /** Positive weights of the same shape, unless the points carry theirs. */ weights?: Array<Array<number>>;
}

/** A border of a part, or a piece of it. Exactly one of side, vertices and boundaries is given. */
export interface Border {
  /** Of a BC-IFS: pairs [root cell, boundary of its state] along the border. */ boundaries?: Array<Array<number>>;
  /** Index of the part. */ part: number;
  /** Of a NURBS, Bezier, tensor or sum surface: the first or last value of u or v. */ side?: "u_min" | "u_max" | "v_min" | "v_max";
  /** Of a subdivision surface: the mesh's vertices along the border, in either direction; the first again at the end of a border that is taken all round. With catmull_clark and loop the edges between them are the spans, with doo_sabin the vertices. */ vertices?: Array<number>;
}

/** A boundary cell of a cell. */
export interface Boundary {
  /** Its columns are the boundary's control points in the cell's barycentric space. */ incidence: Matrix;
  /** Name of the boundary's state. */ state: string;
}

/** The faces as a cage for subdivision: a 2-manifold with boundary, or the first reasons why it is none. */
export interface Cage {
  /** Loops of edges with one face. */ boundary_loops?: number | null;
  /** Edges. */ edges?: number | null;
  /** Vertices less edges plus faces. */ euler?: number | null;
  /** Faces. */ faces: number;
  /** Faces by their number of corners. */ faces_by_corners?: Record<string, number> | null;
  /** Why it is none. */ faults?: Array<Finding>;
  /** Whether it is one. */ manifold: boolean;
}

/** What the service can do. */
export interface Capabilities {
  /** `sha256:` digest of the program that answers: services that tell the same run the same build. Absent where the system does not let it be read. */ build?: string | null;
  /** Output formats. */ formats: Array<FormatCapability>;
  /** The kernel's version: the same input and version give the same bytes. */ kernel_version: string;
  /** Kinds of jobs. */ kinds: Array<JobKind>;
  /** Classics of the library. */ library: Array<string>;
  /** Limits. */ limits: LimitCapability;
  /** Processes with a profile. */ profiles: Array<string>;
}

/** A Catmull-Rom spline. */
export interface CatmullRomScheme {
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The family of the shape. */ family: "catmull_rom";
  /** Intervals of the parameter: all equal, or as the square roots of the distances of the points, or as the distances. */ parametrization?: "uniform" | "centripetal" | "chordal";
}

/**
 * A Catmull-Rom spline. Four points make the span between the second and the third, which it interpolates: an
 * open one goes from the second point to the last but one.
 */
export interface CatmullRomShape {
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The control polygon. */ control_points: Array<Array<number>>;
  /** The family of the shape. */ family: "catmull_rom";
  /** Intervals of the parameter: all equal, or as the square roots of the distances of the points, or as the distances. */ parametrization?: "uniform" | "centripetal" | "chordal";
}

/** Two cells, the first of the first shape. */
export interface CellPairStatement {
  distance_mm: Array<number>;
  /** Address of the first, as `address` takes it. */ first: string;
  /** A point of the first: of a given triangle, segment or point the nearest to the second, of any other cell the one that its address leads to. */ first_mm: Array<number>;
  /** How far `first_mm` and `second_mm` may be from points of the two shapes: rounding. Absent in certificates of before it was told, whose points are the middles of the cells. */ off_mm?: Array<number> | null;
  /** Address of the second; absent where that is no shape. */ second?: string | null;
  /** A point of the second, likewise; of what is no shape the nearest to the first. */ second_mm: Array<number>;
}

/** A cell and a ball that contains it. */
export interface CellPlace {
  /** Its address. */ address: string;
  /** The ball's centre. */ centre_mm: Array<number>;
  /** The ball's radius. */ radius_mm: number;
  /** The name of its state. */ state: string;
}

/**
 * What is proven of a result. Lengths in mm; the same JSON everywhere. Members that do not apply to a result
 * (the genus of a wire) are absent.
 */
export interface Certificate {
  /** The Hausdorff bound that is proven, single-precision rounding of the file included; never above the request. */ achieved_bound_mm: number;
  area_mm2?: Array<number>;
  bbox_mm: Array<Array<Array<number>>>;
  /** Edges with one triangle. */ boundary_edges?: number | null;
  /** Closed curves that the edges with one triangle form. */ boundary_loops?: number | null;
  /** Sealed voids. */ cavities?: number | null;
  centroid_mm?: Array<Array<number>>;
  closing?: ClosingStatement | null;
  /** Connected pieces. */ components?: number | null;
  contact?: ContactStatement | null;
  /** Triangles without area. */ degenerate_triangles?: number | null;
  dimension?: DimensionStatement | null;
  /** Edges of the result. */ edges: number;
  enclosed?: EnclosedStatement | null;
  /** vertices - edges + triangles. */ euler?: number | null;
  extent?: ExtentStatement | null;
  /** Pairs of triangles that run along their edge in the same direction. */ flipped_pairs?: number | null;
  /** Sum of the shells' genera. */ genus?: number | null;
  hausdorff?: HausdorffStatement | null;
  inertia_mm5?: Array<Array<Array<number>>>;
  /** Every point of the exact shape eroded by this much lies in the result: D(r - inner) is inside the solid. */ inner_bound_mm?: number | null;
  /** `sha256:` and the digest of the canonical job document; filled in by the service or the command. */ input_digest: string;
  /** Version of the kernel that made it. */ kernel_version: string;
  /** Edge of the lattice's cubes, where there was a lattice: points, segments and triangles of which few are near to each other are thickened without. */ lattice_pitch_mm?: number | null;
  /** Leaf cells evaluated. A dilation evaluates only cells near its boundary, and one again in every block of the lattice that needs it. */ leaf_cells: number;
  level?: LevelStatement | null;
  mass_g?: Array<number>;
  /** Area of the written mesh. */ mesh_area_mm2?: number | null;
  /** Volume that the written mesh encloses. */ mesh_volume_mm3?: number | null;
  /** Edges with three triangles or more. */ nonmanifold_edges?: number | null;
  /** Vertices whose triangles form several fans. */ nonmanifold_vertices?: number | null;
  operation?: OperationStatement | null;
  oriented_box?: OrientedBoxStatement | null;
  /** The solid is inside D(r + outer). */ outer_bound_mm?: number | null;
  /** Digests of the files, by format; filled in after writing. */ output_digests: Record<string, string>;
  preview?: PreviewStatement | null;
  /** What was done to each input that is a mesh before anything else, when the job asks for a repair. */ repair?: Array<RepairStatement>;
  /** The Hausdorff bound that was asked. */ requested_tolerance_mm: number;
  sections?: SectionsStatement | null;
  self_intersections: "none" | "not_checked" | number;
  /** Connected boundary surfaces: components and cavities. */ shells?: number | null;
  split?: SplitStatement | null;
  stability?: StabilityStatement | null;
  thickness?: ThicknessStatement | null;
  /** Every point of D(r - inner) lies in a ball of this diameter inside the solid. */ thickness_min_mm?: number | null;
  topology_exact?: "not_checked" | boolean;
  topology_stable: "not_checked" | boolean;
  /** Triangles of the result. */ triangles: number;
  /** Vertices of the result. */ vertices: number;
  volume_mm3?: Array<number>;
  wall?: WallStatement | null;
  /** What the user should know, in words. */ warnings: Array<string>;
}

/** A classic of the library. */
export interface ClassicView {
  /** Its name, for addresses and the command line. */ name: string;
  /** Where it comes from. */ source: string;
  /** What people call it. */ title: string;
}

/** How gaps were filled. */
export interface ClosingStatement {
  /** Half of that. C(X) is X and all points that no ball of this radius outside of X can reach. The result holds C(D(r - inner)) and lies in C(D(r + outer)). */ ball_radius_mm: number;
  /** Gaps narrower than this are filled. */ width_mm: number;
}

/**
 * Masks of the faces of a region: a geometric texture. Faces that arise between faces of one region belong to
 * it.
 */
export interface Coefficients {
  /** The faces of the region; all when absent. */ faces?: Array<number>;
  /** Lists of n weights that sum to 1, for faces of n sides: of the corner itself, of the next vertex, and so on. Faces of other numbers of sides keep the scheme's. */ weights: Array<Array<number>>;
}

/**
 * How far two shapes are apart, and where they come within the tolerance of each other; or a shape and itself,
 * but for what it joins. A model that stands for a solid has its inside: what lies there is at the distance 0.
 * Places and the nearest pair are those of surfaces.
 */
export interface ContactStatement {
  /** Whether there are no other places, and the distance is as narrow as the tolerance allows. */ complete: boolean;
  distance_mm: Array<number>;
  inside?: InsideStatement | null;
  /** The nearest pair of cells that was looked at. */ nearest: CellPairStatement;
  /** Pairs of cells whose distance was bounded: what the search cost. */ pairs_looked_at: number;
  /** The places, a thousand at most. */ places: Array<PlaceStatement>;
  /** What is proven. */ verdict: ContactVerdict;
}

/** What is proven of two shapes, at a place or as a whole. */
export type ContactVerdict = "disjoint" | "near" | "touching";

/** A polygon mesh whose neighbouring faces run along their common edge in opposite directions. */
export interface ControlMesh {
  /** The vertices of each face, counter-clockwise seen from outside. */ faces: Array<Array<number>>;
  /** The vertices. */ vertices: Array<Array<number>>;
}

/**
 * A point [x, y, z], or [x, y, z, w] with a positive weight w (1 when absent). The coordinates are those of the
 * point, not multiplied by w.
 */
export type ControlPoint = Array<number>;

/** What was copied. */
export type CopiedPrimitive = "stated" | "box";

/** A vertex that is sharp for some steps of the scheme or for ever. */
export interface Corner {
  /** Number of steps, fractions allowed; 10 and more is "infinite", as in OpenSubdiv. */ sharpness: number | "infinite";
  /** The vertex. */ vertex: number;
}

/** The corner-cutting scheme (a, b). */
export interface CornerCuttingScheme {
  /** First parameter; 1/4 when absent. */ a?: number;
  /** Second parameter; 1/4 when absent. */ b?: number;
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The family of the shape. */ family: "corner_cutting";
}

/** The limit of the corner-cutting scheme (a, b) on a control polygon; a = b = 1/4 is Chaikin's. */
export interface CornerCuttingShape {
  /** First parameter; 1/4 when absent. */ a?: number;
  /** Second parameter; 1/4 when absent. */ b?: number;
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The control polygon. */ control_points: Array<Array<number>>;
  /** The family of the shape. */ family: "corner_cutting";
}

/** A point around which a closed surface winds neither once nor not at all. */
export interface CountedPoint {
  /** The point. */ point_mm: Array<number>;
  /** How often it counts in the volume; below 0 where it is taken away. */ times: number;
}

/** How many jobs of a batch stand where. */
export interface Counts {
  /** Those that were stopped. */ cancelled: number;
  /** Those of which nothing else is kept any more. */ expired: number;
  /** Those that ended with a problem. */ failed: number;
  /** Those that wait for a worker. */ queued: number;
  /** Those that workers are at, also those that are stopping. */ running: number;
  /** Those that are done. */ succeeded: number;
}

/** An edge that is sharp for some steps of the scheme or for ever. */
export interface Crease {
  /** The two vertices of the edge. */ edge: Array<number>;
  /** Number of steps, fractions allowed; 10 and more is "infinite", as in OpenSubdiv. */ sharpness: number | "infinite";
}

/** Radii where the topology changes, or may. */
export interface CriticalRadiusStatement {
  /** What happens there. */ change: TopologyChange;
  /** What it adds to the Euler number of the solid (half of its boundary's), where that is proven. */ euler?: number | null;
  /** At how many places. */ places: number;
  /** Whether it is proven that it happens; else it may. */ proven: boolean;
  radius_mm: Array<number>;
}

/** A curve shape without control points. */
export type CurveScheme = BezierScheme | NurbsScheme | CatmullRomScheme | BetaSplineScheme | CornerCuttingScheme | FourPointScheme | InterpolationScheme | BcifsScheme | IfsScheme;

/** A curve. */
export type CurveShape = BezierCurveShape | NurbsCurveShape | CatmullRomShape | BetaSplineShape | CornerCuttingShape | FourPointShape | InterpolationShape;

/** A declared parameter that the constraints determine. */
export interface DeterminedParameter {
  /** Its name. */ name: string;
  /** The document's value. */ stated: number;
  /** The only value that satisfies the constraints. */ value: number;
}

/** How much is known of a dimension. */
export type DimensionBasis = "elementary" | "similarities" | "overlapping_similarities" | "contraction";

/** A fractal dimension. */
export interface DimensionStatement {
  /** How they are known. */ basis: DimensionBasis;
  bounds: Array<number>;
}

/** How far the points of one shape are from the other, at most. */
export interface DirectedStatement {
  distance_mm: Array<number>;
  /** Near here is a point that far. */ near_mm: Array<number>;
}

/** A model inside a job: as a model on its own, but the version may be left to the job. */
export interface EmbeddedModel {
  /** The version of the grammar: 1. */ lacuna?: 1;
  /** What the author calls the model. */ name?: string;
  /** The shape, of one of the families. */ shape: Shape;
  /** The unit of every length of the model; converted to mm on reading. Weights, linear parts and operators have no unit. */ units?: "um" | "mm" | "cm" | "m" | "in";
}

/** The volume that a closed surface encloses. The surface itself, being a sheet, has none. */
export interface EnclosedStatement {
  /** Proven: every point farther than this from the surface is counted once, or not at all. Absent where that is not known; nearer ones are not checked. */ counted_once_beyond_mm?: number | null;
  counted_otherwise?: CountedPoint | null;
  /** How it was found. */ method: VolumeMethod;
  volume_mm3: Array<number>;
}

/** An exact number. */
export interface ExactNumber {
  /** As a fraction in lowest terms, for example `-3/4`; a decimal where the fraction outgrew 256 bits. */ exact: string;
  /** The nearest double. */ value: number;
}

/** A limit that a plan exceeds. */
export interface Excess {
  /** What is allowed. */ allowed: number;
  /** What is predicted. */ asked: number;
  /** Its name among the limits of a job: `cells`, `triangles`, `memory_bytes` or `output_bytes`. */ limit: string;
  /** A parameter of the job, or the limit where no tolerance is enough, and a value that would pass. Empty when the search for one took too long. */ remedy: Record<string, number>;
}

/** How far a shape extends along a direction: between two planes across it that touch the shape. */
export interface ExtentStatement {
  /** The direction, of length 1. */ direction: Array<number>;
  from_mm: Array<number>;
  to_mm: Array<number>;
  width_mm: Array<number>;
}

/**
 * The key figures of a job's certificate, which says what each of them means; all of it is the output
 * `certificate.json`.
 */
export interface Figures {
  /** The bound that is proven. */ achieved_bound_mm: number;
  /** Connected pieces. */ components?: number | null;
  /** Sum of the shells' genera. */ genus?: number | null;
  /** Area of the written mesh. */ mesh_area_mm2?: number | null;
  /** Volume that the written mesh encloses. */ mesh_volume_mm3?: number | null;
  /** The bound that was asked. */ requested_tolerance_mm: number;
  /** Least thickness that is proven. */ thickness_min_mm?: number | null;
  /** Triangles of the result. */ triangles: number;
}

/** One finding with its place. */
export interface Finding {
  /** Stable code, for example `ifs.not-contractive`. */ code: string;
  /** Column of the value in its line, from 1. */ column?: number | null;
  /** Line of the value in the document, from 1. */ line?: number | null;
  /** What, in words, with the values. */ message: string;
  /** JSON pointer into the request's document. */ pointer: string;
}

/** An output format. */
export interface FormatCapability {
  /** What it has room for: `solid`, `surface`, `wires`, `points`. */ carries: Array<string>;
  /** Its media type. */ media_type: string;
  /** Its name in `outputs`. */ name: string;
  /** Whether files of it can be uploaded. */ reads: boolean;
}

/** The four-point scheme. */
export interface FourPointScheme {
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The family of the shape. */ family: "four_point";
  /** Tension; 1/16, which reproduces cubics, when absent; 0 gives the polygon. */ w?: number;
}

/**
 * The interpolating four-point scheme. Six points make the span between the third and the fourth: an open one
 * goes from the third point to the last but two.
 */
export interface FourPointShape {
  /** Whether the polygon is closed. */ closed?: boolean;
  /** The control polygon. */ control_points: Array<Array<number>>;
  /** The family of the shape. */ family: "four_point";
  /** Tension; 1/16, which reproduces cubics, when absent; 0 gives the polygon. */ w?: number;
}

/** An unknown that the constraints leave free. */
export interface FreeParameter {
  /** Whether the model declares it in `parameters`. */ declared: boolean;
  /** The model's parameter, or the entry that stays free: `face.1[2][0]` (state, transition, row, column), `face.boundary0[1][0]`, `cell0.point3.x`. A value is chosen under this name. */ name: string;
  /** JSON pointer into the model document. */ pointer: string;
  /** Its value in the filled model. */ value: number;
}

/** Two boundaries of root cells that are one. */
export interface Glue {
  /** Two pairs [root cell, boundary of its state]. */ between: Array<Array<number>>;
  /** The order in which the second's control points are taken: the k-th of the first is number permutation[k] of the second. Excludes reversed. */ permutation?: Array<number>;
  /** Whether the second is seen from its other end. */ reversed?: boolean;
}

/** The union of several shapes. */
export interface GroupShape {
  /** The family of the shape. */ family: "group";
  /** Borders of parts that become one, so that the parts share the edges and vertices there, or that a strip joins. */ joins?: Array<Join>;
  /** The shapes, each with an optional name and place. */ parts: Array<Part>;
}

/** The Hausdorff distance of two shapes. A model that stands for a solid is all that it encloses. */
export interface HausdorffStatement {
  /** Whether the intervals are as narrow as the tolerance. */ complete: boolean;
  distance_mm: Array<number>;
  /** From the first shape to the second. */ from_first: DirectedStatement;
  /** From the second shape to the first. */ from_second: DirectedStatement;
}

/** What a probe learns. */
export interface Health {
  /** `ok`. */ status: string;
}

/** Which of two shapes holds the other, or a part of it. */
export type Holder = "first" | "second";

/**
 * The curve of affine maps whose images follow each other, drawn in the affine frame of four control points: o,
 * o + x, o + y, o + z.
 */
export interface IfsScheme {
  /** The family of the shape. */ family: "ifs";
  /** The maps, in order along the curve. */ maps: Array<AffineMap>;
}

/** An iterated function system: the compact set A with A = union of T_i A, for affine maps T_i of space. */
export interface IfsShape {
  /** The family of the shape. */ family: "ifs";
  /** Which maps may follow which in an address: one list of indices of maps per map, or a square matrix of booleans. All may follow all when absent. */ graph?: Array<Array<number>> | Array<Array<boolean>>;
  /** The maps T_i. */ maps: Array<AffineMap>;
  /** The compact drawn at the leaves; a point of each leaf cell when absent. */ primitive?: Primitive;
}

/** The j-th child of boundary `boundary` is boundary m of child i, with [i, m] = children[j]. */
export interface Incidence {
  /** Index of the boundary. */ boundary: number;
  /** Pairs [child, boundary of that child]. */ children: Array<Array<number>>;
  /** Name of the state. */ state: string;
}

/** A solid that holds another shape, or a part of it, without touching it with its surface. */
export interface InsideStatement {
  /** Which of the two is the solid that holds. */ holder: Holder;
  /** A point inside of it that is on the other, or nearer to it than their surfaces are to each other. */ point_mm: Array<number>;
  surface_distance_mm: Array<number>;
}

/** A fractal interpolation function at equal distances. */
export interface InterpolationScheme {
  /** The family of the shape. */ family: "interpolation";
  /** One factor per interval, between -1 and 1. */ vertical_scaling: Array<number>;
}

/** The graph of a fractal interpolation function: exactly one of vertical_scaling and maps. */
export interface InterpolationShape {
  /** The family of the shape. */ family: "interpolation";
  /** One affine map per interval: it takes the first and the last point to the interval's. */ maps?: Array<AffineMap>;
  /** The points that the graph goes through, x increasing; in any order with maps. */ points: Array<Array<number>>;
  /** One factor per interval, between -1 and 1: over the interval stands the whole graph, scaled by it, plus what is linear along x. */ vertical_scaling?: Array<number>;
}

/**
 * An order: what to do, with which model, how precisely, and what to deliver. Exactly one of model, model_ref
 * and inputs is given.
 */
export interface Job {
  /** Named models, for kinds of jobs with several. */ inputs?: Array<JobInput>;
  /** What to do: evaluate (points, wires or surface to the tolerance), solidify (a printable solid: the shape dilated by a ball, a wall, or a level of an ifs), measure (box, area and volume as intervals), intersect (a printable solid: what an operation leaves of several), slice (plane sections of a solid), or convert (a mesh as it is, in other formats; any other model is evaluated). */ kind: "evaluate" | "solidify" | "measure" | "intersect" | "slice" | "convert";
  /** The version of the grammar: 1. */ lacuna: 1;
  /** What the job may use; the service's defaults when absent. */ limits?: JobLimits;
  /** The model, in full. */ model?: EmbeddedModel;
  /** The id of a stored model or of an uploaded mesh file. */ model_ref?: string;
  /** Names of the formats wanted, for example 3mf and stl. A measure makes none, but ply with thickness. */ outputs?: Array<"stl" | "3mf" | "glb" | "obj" | "ply" | "off" | "wrl" | "png" | "csv" | "svg" | "dxf">;
  /** How to do it. */ params: JobParams;
  /** For a service: the id of a job that is stopped once this one is accepted, because nobody wants it any more. */ supersedes?: string;
}

/** A named model. Exactly one of model and model_ref is given. */
export interface JobInput {
  /** The model, in full. */ model?: EmbeddedModel;
  /** The id of a stored model or of an uploaded mesh file. */ model_ref?: string;
  /** What the job calls the model. */ name: string;
  /** For intersect alone: the radius of the ball that dilates this input, in mm; 0 takes the solids that its closed surfaces bound as they are; the radius_mm of params when absent, and 0 without one. */ radius_mm?: number;
}

/** What a job does. */
export type JobKind = "evaluate" | "solidify" | "measure" | "intersect" | "slice" | "convert";

/** What a job may use. Each limit that is absent is the service's default. */
export interface JobLimits {
  /** Leaf cells that may be expanded: of an evaluation all of the shape's, of each dilation those that its surface needs, one again in every block of its lattice. A comparison of shapes looks at no more nodes than this, and ends there with what it knows. */ cells?: number;
  /** Length of the longest address. */ depth?: number;
  /** Accounted memory in bytes. */ memory_bytes?: number;
  /** Bytes of all files of the result, the certificate aside. */ output_bytes?: number;
  /** Wall time in seconds. */ seconds?: number;
  /** Triangles of the result. */ triangles?: number;
}

/** A page of jobs. */
export interface JobPage {
  /** The jobs, the newest first. */ items: Array<JobView>;
  /** The cursor of the next page, if there is one. */ next?: string | null;
}

/** Settings of a job. What a kind does not use must be absent. */
export interface JobParams {
  /** For split, with key_mm and only with it: the distance between the faces of a peg and of its socket, in mm. */ clearance_mm?: number;
  /** Gaps of the dilated shape that are narrower than this are filled, in mm, above zero: by closing it with a ball of half the size. For solidify with radius_mm alone. */ closing_mm?: number;
  /** For split: where to cut across x, y and z, in mm: three arrays, empty where the volume tells or nothing is cut. */ cuts_mm?: Array<Array<number>>;
  /** The density of the material, in g/cm3, above zero, for the mass: for measure alone. */ density_g_cm3?: number;
  /** Along which the extent of the shape is told, as by planes that touch it on both sides, of any length: for measure alone. */ direction?: Array<number>;
  /** For split: the width and length of pegs that stand in sockets of the neighbouring parts, in mm; walls are half of that. No keys when absent. */ key_mm?: number;
  /** For solidify of a model of the family ifs, instead of radius_mm: the union of all copies of the primitive along addresses of this length, as an exact solid; the primitive is the model's solid, or else the box of its attractor. */ level?: number;
  /** What the planes of slice are perpendicular to, of any length; [0, 0, 1] when absent. */ normal?: Array<number>;
  /** Whether an evaluation carries the normals of the limit surface into PLY, OBJ, GLB and VRML: for evaluate alone; false when absent. */ normals?: boolean;
  /** Where the planes of slice are along the normal, in mm. Exactly one of offsets_mm and step_mm is given. */ offsets_mm?: Array<number>;
  /** What intersect leaves of the solids of its inputs: what lies in any of them (union), in all of them (intersection), in the first and in none of the others (difference), or their convex hull (hull); of one input, what lies behind a plane (trim), or its parts between planes (split). For intersect alone; without it intersect tells where two shapes come within the tolerance of each other, and makes no file. */ operation?: "union" | "intersection" | "difference" | "hull" | "trim" | "split";
  /** Whether the smallest box around the shape is found, whatever way it is turned: for measure alone; false when absent. */ oriented_box?: boolean;
  /** For trim: the normal of a plane, of any length, and its distance from the origin along that, in mm. What the normal points to is taken away. */ plane?: Array<number>;
  /** Whether a preview is enough, which takes a second or two and is written as glb alone: for solidify the dilation as coarse as its ball allows, or where that is too much the shape without its ball, for evaluate the shape at the finest tolerance of which it has few enough cells. The certificate's preview says which, and with which tolerance; everything else in the certificate is of what is shown. For evaluate, and for solidify without level, closing_mm, wall_mm and stability; false when absent. */ preview?: boolean;
  /** The radius of the dilating ball, in mm, above zero: required by solidify unless wall_mm or level is there, optional for measure, intersect and slice, absent for evaluate and convert. */ radius_mm?: number;
  /** Whether inputs of the family mesh are made solids first, the certificate telling what was done to each: vertices at the same place are joined, triangles without area and copies are taken away, corners are doubled where parts meet in edges or corners only, and triangles are turned so that material is behind them. No point is moved. Holes of up to 64 edges, of at most a quarter of the area of the surface, are closed by triangles between their corners that meet nothing else; other open meshes are refused with the place. Absent for evaluate; false when absent. */ repair?: boolean;
  /** On which side of that surface the wall is: inward (the solid becomes hollow) or outward (what the surface bounds becomes the hollow); inward when absent. */ side?: "inward" | "outward";
  /** Whether triangles are saved within the bound: for solidify alone; true when absent. */ simplify?: boolean;
  /** Whether the certificate says at which radii from half to twice radius_mm the topology changes, and from which on the shape is one piece: for solidify alone; false when absent. */ stability?: boolean;
  /** The height of layers, in mm, above zero: planes of slice are in their middles, from the bottom of the solid to its top. */ step_mm?: number;
  /** Whether the least thickness of walls and gaps is found, along the normals of faces: for measure of a solid alone; false when absent. With the output ply its map is made too: the mesh that is measured, with the thickness over every face as the property wall_mm (inwards) and gap_mm (outwards), and at every vertex the least of the faces around it; inf where no face lies across. */ thickness?: boolean;
  /** The Hausdorff bound on the result, in mm, above zero. Required but with level, which is exact but for the single precision of the files. */ tolerance_mm?: number;
  /** For split: the build volume along x, y and z, in mm, which every part fits; along axes without cuts of their own the job cuts as rarely as it can. */ volume_mm?: Array<number>;
  /** The thickness of a wall along the surface of the solid, in mm, above zero, which is made instead of the solid: of the dilation where there is a radius_mm, else of what the model's closed surface bounds. For solidify alone. */ wall_mm?: number;
  /** What the one input of intersect is held against, where there is neither a second one nor an operation. */ with?: With;
}

/** Where a job stands. */
export type JobState = "queued" | "running" | "cancelling" | "succeeded" | "failed" | "cancelled" | "expired";

/** A job as its owner sees it. */
export interface JobView {
  /** How often it was started; 2 after the service stopped during the first time. */ attempt: number;
  /** The id of the batch that it belongs to, if it does. */ batch?: string | null;
  certificate?: Certificate | null;
  /** When it was accepted. */ created: string;
  /** When what it made was given up, after the time for which ended jobs are kept; the digests of its outputs are still told. */ expired?: string | null;
  /** When it ended. */ finished?: string | null;
  /** How often a worker gave it back because it was told to end; those starts are not counted against the job. */ handed_back?: number;
  /** Its id. */ id: string;
  /** `sha256:` digest of the canonical job document. */ input_digest: string;
  /** What it does. */ kind: JobKind;
  /** The files it made. */ outputs: Array<Output>;
  problem?: Problem | null;
  progress?: Step | null;
  /** Whether the same work had been done before and its results are handed out again. */ reused: boolean;
  /** When a worker took it. */ started?: string | null;
  /** Where it stands. */ state: JobState;
  /** What the owner should know, in words. */ warnings: Array<string>;
}

/** Two borders of parts that become one: they are the same curve, span by span, whichever way each runs. */
export interface Join {
  /** The two borders. */ between: Array<Border>;
  /** Whether a strip fills the space between the borders, of a bicubic and a biquadratic surface (NURBS with knots that are uniform along the border, regular Catmull-Clark and Doo-Sabin), and meets both with their tangent planes. */ strip?: boolean;
}

/** Where a number comes from. */
export type Kind = "sourced" | "chosen";

/** A least thickness, and where it is. */
export interface LeastThicknessStatement {
  /** A point of a face, and the one across. */ between_mm: Array<Array<number>>;
  least_mm: Array<number>;
}

/**
 * A level of a system as a solid. Its copies have no inner point in common, proven in integers; faces of theirs
 * that coincide are gone, by integers as well. The box, the volume and the area beside it are those of the exact
 * level, not of the attractor.
 */
export interface LevelStatement {
  /** Faces that cancelled in the last step from level to level. */ cancelled_faces: number;
  /** Copies that were joined. */ copies: number;
  /** Corners that were doubled, because parts of the solid meet there, or along edges there, without being joined. */ doubled_vertices: number;
  /** The level: the length of the addresses of the copies. */ level: number;
  /** What was copied. */ primitive: CopiedPrimitive;
}

/** The library. */
export interface LibraryPage {
  /** The classics, sorted by name. */ items: Array<ClassicView>;
}

/** The limits of a request and of a job. */
export interface LimitCapability {
  /** Jobs that a batch may have. */ batch_jobs: number;
  /** Bytes of a JSON body. */ body_bytes: number;
  /** Other calls per minute and key. */ calls_per_minute: number;
  /** Most leaf cells that a job may expand. */ cells: number;
  /** Longest address. */ depth: number;
  /** Hours after that for which an expired job is still known. */ expired_hours: number;
  /** Unfinished jobs that one key may have. */ jobs_per_key: number;
  /** Most accounted memory of a job, in bytes. */ memory_bytes: number;
  /** Most bytes of all files of a result. */ output_bytes: number;
  /** Jobs that may wait. */ queued_jobs: number;
  /** Hours after which ended jobs expire: what they made is given up. */ retention_hours: number;
  /** Most wall time of a job, in seconds. */ seconds: number;
  /** Bytes of all models and mesh files that one key may keep. */ stored_bytes: number;
  /** Submissions per minute and key. */ submissions_per_minute: number;
  /** Most triangles of a result. */ triangles: number;
  /** Bytes of an uploaded mesh file. */ upload_bytes: number;
  /** Seconds that `Prefer: wait` may ask. */ wait_seconds: number;
}

/** What is known of a solution that was found locally. */
export interface LocalSolution {
  /** Equations that were left. */ equations: number;
  /** Rank of their Jacobian at the solution. */ rank: number;
  /** Starts tried until the solution was found. */ starts: number;
  /** Unknowns in the equations that were left. */ unknowns: number;
}

/** The point at an address. */
export interface LocatedPoint {
  /** The address of the point: the one that was asked; that of a cell is continued by the first transition of every state. */ address: string;
  /** The exact point is no farther from it than this: proven. */ bound_mm: number;
  /** The cell at the end of what comes before the period. */ cell: CellPlace;
  /** The point. */ point_mm: Array<number>;
}

/** A material. */
export interface Material {
  /** Its density in g/cm3; an alloy's own data sheet goes before it. */ density_g_cm3: number;
  /** Its name. */ name: string;
  /** How far sources disagree. */ range_g_cm3?: Array<number> | null;
  /** Where the numbers come from. */ source: string;
  /** What people call it. */ title: string;
}

/** The materials. */
export interface MaterialPage {
  /** The materials, sorted by name. */ items: Array<Material>;
}

/**
 * An array of rows of one length. An entry is a number, null (unknown, to be solved) or the name of one of the
 * model's parameters.
 */
export type Matrix = Array<Array<number | null | string>>;

/** Corner points, and the indices of each face's corners. */
export interface MeshData {
  /** The corner indices of each face, counter-clockwise seen from outside. */ faces: Array<Array<number>>;
  /** The corner points. */ vertices: Array<Array<number>>;
}

/** The bytes of a mesh file. */
export type MeshFile = string;

/** What a mesh file holds. Nothing of it was repaired. */
export interface MeshReport {
  /** Area of all faces. */ area_mm2?: number | null;
  /** Lower and upper corner. */ bbox_mm?: Array<Array<number>> | null;
  /** Edges of one triangle. */ boundary_edges: number;
  /** Length of the file. */ bytes: number;
  /** The faces as a cage for subdivision. */ cage: Cage;
  /** Shells that look inwards: sealed voids. */ cavities: number;
  /** Whether the mesh is closed, oriented and manifold. */ closed_manifold: boolean;
  /** Connected pieces of material: shells that do not look inwards. */ components: number;
  /** Triangles without area. */ degenerate_triangles: number;
  /** Edges. */ edges: number;
  /** `binary`, `binary big-endian`, `ascii` or `xml`. */ encoding: string;
  /** Vertices less edges plus triangles. */ euler: number;
  /** Pairs of neighbours that disagree about the outside. */ flipped_pairs: number;
  /** The format it was read as. */ format: string;
  /** Handles of all pieces, if the mesh is a closed 2-manifold. */ genus?: number | null;
  /** What holds no polygons and was left out, by kind: shapes, and segments and points beside faces. */ left_out: Record<string, number>;
  /** Edges of three triangles or more. */ nonmanifold_edges: number;
  /** Vertices whose triangles are no single fan. */ nonmanifold_vertices: number;
  /** Names of objects. */ objects: Array<string>;
  /** Points, of a file without faces: of a PLY file that has vertices alone, all of them. */ points?: number;
  /** Polygons of four corners or more. */ polygons_fanned: number;
  /** What a slicer will ask or suffer from, with the way out. */ prompts: Array<Prompt>;
  /** Segments, of a file without faces. */ segments?: number;
  /** Connected pieces of surface. */ shells: number;
  /** Triangles. */ triangles: number;
  /** The unit that the file names, or that it names none. */ unit: string;
  /** Vertices. */ vertices: number;
  /** What the faces enclose; means nothing unless the mesh is closed. */ volume_mm3?: number | null;
}

/** A polygon mesh: faces of one corner are points, of two segments, of three and more polygons. */
export interface MeshShape {
  /** The corner indices of each face, counter-clockwise seen from outside; unless there is a file. */ faces?: Array<Array<number>>;
  /** The family of the shape. */ family: "mesh";
  /** Instead of vertices and faces: an STL, 3MF, OBJ, PLY, OFF or VRML file, by its path in the document's folder. Polygons stay polygons; lengths are in the file's unit, or in the document's if the file names none. Only for documents that are read from a folder. */ file?: string;
  /** Whether the mesh stands for the solid that it bounds or for its surface; `auto`: the solid if it is closed. */ interior?: "auto" | "solid" | "surface";
  /** The corner points; unless there is a file. */ vertices?: Array<Array<number>>;
}

/** A shape with its unit. Lengths without a unit are mm. */
export interface Model {
  /** The version of the grammar: 1. */ lacuna: 1;
  /** What the author calls the model. */ name?: string;
  /** The shape, of one of the families. */ shape: Shape;
  /** The unit of every length of the model; converted to mm on reading. Weights, linear parts and operators have no unit. */ units?: "um" | "mm" | "cm" | "m" | "in";
}

/** A page of models. */
export interface ModelPage {
  /** The models, sorted by id. */ items: Array<ModelView>;
  /** The cursor of the next page, if there is one. */ next?: string | null;
}

/** What is told of a stored model. */
export interface ModelView {
  /** Length of the canonical document, or of the mesh file. */ bytes: number;
  /** When it was first stored. */ created: string;
  /** `sha256:` digest of the canonical document, or of the mesh file. */ digest: string;
  /** Its id, chosen by its contents. */ id: string;
  mesh?: MeshReport | null;
  /** The author's name for it. */ name?: string | null;
}

/** A cell near the point. */
export type NearbyCell = unknown;

/** The shape near a point. */
export interface NearbyCells {
  /** The cells, closest first. */ cells: Array<NearbyCell>;
  /** Whether all cells as near as asked are listed. */ complete: boolean;
  /** The closest point of the shape, up to the tolerance. */ nearest: NearestPoint;
  /** The point that was asked. */ point_mm: Array<number>;
  /** The radius to which cells were refined. */ tolerance_mm: number;
  /** The distance that was asked, if one was. */ within_mm?: number | null;
}

/** A point of the shape with its distance. */
export interface NearestPoint {
  /** Its address. */ address: string;
  /** The exact point is no farther from it than this. */ bound_mm: number;
  /** The distance of the shape from the point that was asked lies in this interval: proven. */ distance_mm: Array<number>;
  /** The point. */ point_mm: Array<number>;
}

/**
 * A polynomial or rational spline of any degree from 1 to 9 on any knots: clamped, periodic, with multiple
 * knots.
 */
export interface NurbsCurveShape {
  /** The control points, in order. */ control_points: Array<ControlPoint>;
  /** The degree d, from 1 to 9. */ degree: number;
  /** The family of the shape. */ family: "nurbs_curve";
  /** The full knot vector: as many as control points, plus d + 1; not decreasing, multiplicities up to d + 1. The curve is defined from knot d to knot n, n being the number of control points. */ knots: Array<number>;
  /** One positive weight per control point, unless the points carry theirs. */ weights?: Array<number>;
}

/** A spline of any degree on any knots. */
export interface NurbsScheme {
  /** The degree d, from 1 to 9. */ degree: number;
  /** The family of the shape. */ family: "nurbs_curve";
  /** The full knot vector: as many as control points, plus d + 1; not decreasing, multiplicities up to d + 1. The curve is defined from knot d to knot n, n being the number of control points. */ knots: Array<number>;
}

/**
 * A polynomial or rational spline surface. Directions whose ends meet are closed; sides that are single points
 * are poles.
 */
export interface NurbsSurfaceShape {
  /** control_points[i][j], i along the first direction. */ control_points: Array<Array<ControlPoint>>;
  /** The degree, from 1 to 9, or one for each direction. */ degree: number | Array<number>;
  /** The family of the shape. */ family: "nurbs_surface";
  /** A full knot vector for each direction. */ knots: Array<Array<number>>;
  /** Loops that cut the surface in its parameter plane; the whole surface when absent. */ trim?: Trim;
  /** Positive weights of the same shape, unless the points carry theirs. */ weights?: Array<Array<number>>;
}

/** A polynomial or rational spline volume. */
export interface NurbsVolumeShape {
  /** control_points[i][j][k], i along the first direction. */ control_points: Array<Array<Array<ControlPoint>>>;
  /** The degree, from 1 to 9, or one for each direction. */ degree: number | Array<number>;
  /** The family of the shape. */ family: "nurbs_volume";
  /** A full knot vector for each direction. */ knots: Array<Array<number>>;
  /** Positive weights of the same shape, unless the points carry theirs. */ weights?: Array<Array<Array<number>>>;
}

/** One input of an operation. */
export interface OperandStatement {
  /** Its mesh contains D(r - inner). */ inner_bound_mm: number;
  /** Volume that its mesh encloses: the sum over its closed surfaces. */ mesh_volume_mm3: number;
  /** Its name. */ name: string;
  /** Its mesh lies in D(r + outer). */ outer_bound_mm: number;
  /** The radius r of its ball; 0 for the solid itself. */ radius_mm: number;
  /** Triangles of its mesh. */ triangles: number;
}

/**
 * How solids are combined. All operations are regularised: a face, an edge or a point that two solids merely
 * share leaves nothing behind.
 */
export type Operation = "union" | "intersection" | "difference" | "hull" | "trim" | "split";

/**
 * A solid that was combined from several. `inner_bound_mm` and `outer_bound_mm` say how far inputs are eroded or
 * dilated in the two solids that the result lies between: it contains the operation of the inputs at radius r -
 * inner, and lies in that at radius r + outer, where inputs that are taken away are at r + inner and r - outer.
 * The engine is trusted to combine meshes as it says; that the result is a closed solid is counted.
 */
export interface OperationStatement {
  /** By which engine. */ engine: string;
  /** The inputs. */ operands: Array<OperandStatement>;
  /** What was done. */ operation: Operation;
}

/** The smallest box around the exact shape, whatever way it is turned. */
export interface OrientedBoxStatement {
  /** Unit vectors along the edges of a box that holds the shape. */ axes: Array<Array<number>>;
  /** Its middle. */ centre_mm: Array<number>;
  /** Whether the bounds are within a thousandth of each other, and what the tolerance takes. */ complete: boolean;
  /** Its edges. */ sizes_mm: Array<number>;
  volume_mm3: Array<number>;
}

/** A file that a job made. */
export interface Output {
  /** Its length. */ bytes: number;
  /** `sha256:` and 64 hex digits; also its address under `/v1/results/`. */ digest: string;
  /** What to call the file. */ file_name: string;
  /** Its media type. */ media_type: string;
  /** The format's name, or `certificate.json`. */ name: string;
}

/** A shape with an optional name and place: beside the shape's own members, or with the shape as a member. */
export type Part = unknown;

/** A part of a solid that was split. */
export interface PartStatement {
  /** Lower and upper corner of its box where it lies in the files, pegs included. */ bbox_mm: Array<Array<number>>;
  /** Its pieces. */ components: number;
  /** Volume that its mesh encloses. */ mesh_volume_mm3: number;
  /** How far it was moved from where it belongs. */ moved_mm: Array<number>;
  /** Its name in the files: its place along x, y and z, from 1. */ name: string;
  /** Its pegs. */ pegs: number;
  /** Its sockets. */ sockets: number;
  /** Its triangles. */ triangles: number;
}

/** A place where shapes come within the tolerance. */
export interface PlaceStatement {
  /** Lower and upper corner of a box that holds all points of the first shape within the tolerance of the second, of this place. */ bbox_mm: Array<Array<number>>;
  distance_mm: Array<number>;
  /** The nearest of them. */ nearest: CellPairStatement;
  /** Pairs of cells that make up the place. */ pairs: number;
  /** What is proven there. */ verdict: ContactVerdict;
}

/** What a job is predicted to cost. */
export interface Plan {
  /** Leaf cells against which the limit of cells is held: of an evaluation all of the shape's, of a dilation those that its surface needs, one again in every block of the lattice that needs it. Of several solids those of the largest, as each is held against the limit by itself. */ counted_cells?: number;
  /** Triangles against which the limit of triangles is held: those of the lattices as they are first made. */ counted_triangles?: number;
  /** Seconds that one core takes, an estimate for a machine like that on which the constants were measured: `fixtures/ESTIMATES.md`. Reading and lowering the models, which a plan takes as long for, are not in it. `null` where they are not predicted: comparisons, sections, and what is searched for besides (`stability`, `thickness`, `oriented_box`, the other surface of a wall, the closing of gaps). */ cpu_seconds?: number | null;
  exceeds?: Excess | null;
  /** Edge of the lattice's cubes. `null` where points, segments and triangles are thickened without a lattice, and where nothing is thickened. */ lattice_pitch_mm?: number | null;
  /** Leaf cells of the whole shape at its share of the tolerance; `solidify` expands only those that the boundary of the result needs. */ leaf_cells: number;
  /** Peak memory of the process that does the job, in bytes. 0 where nothing is predicted. */ memory_bytes: number;
  /** Bytes of a binary STL file with so many `triangles`; of sections, those of all drawings that are asked for, or else of one in SVG. `null` for sections of what is thickened first, and where nothing is predicted. */ output_bytes?: number | null;
  /** The result is nowhere thinner than this, in mm: of a dilation 2 (r - tolerance) with the least radius r, and never less than r; of a wall its thickness less the tolerance. The certificate's `thickness_min_mm` is this or more. `null` where nothing is proven before the work: meshes as they are, booleans, levels, closed gaps. */ smallest_feature_mm?: number | null;
  /** Triangles of the result without simplification, which leaves a tenth to a hundredth of them. Of an operation on solids: those of its result. */ triangles: number;
}

/** One section. */
export interface PlaneStatement {
  /** Their area. */ area_mm2: number;
  /** Holes in them. */ holes: number;
  /** Where the plane is along the normal. */ offset_mm: number;
  /** Length of all loops. */ perimeter_mm: number;
  /** Connected pieces; 0 where the plane misses the solid. */ polygons: number;
}

/** That a result is a preview. */
export interface PreviewStatement {
  /** The tolerance of the job: that of its result without `preview`. */ final_tolerance_mm: number;
  /** The tolerance of the preview, never less; the bounds of the certificate are held against this one. */ tolerance_mm: number;
  /** Whether the shape itself is shown, and not its dilation by the ball of the job, because that would take too long: then all of the certificate is of the shape itself. */ without_ball: boolean;
}

/** A compact set: exactly one of points, a polyline, a mesh taken as a surface, or a solid. */
export interface Primitive {
  /** Whether the polyline's last corner is joined to its first; only with `polyline`. */ closed?: boolean;
  /** A polygon mesh, taken as a surface. */ mesh?: MeshData;
  /** Points. */ points?: Array<Array<number>>;
  /** The corners of a polyline, in order. */ polyline?: Array<Array<number>>;
  /** A closed polygon mesh with outward faces, taken with its interior. */ solid?: MeshData;
}

/**
 * A problem (RFC 9457): the body of every error answer, the `problem` of a failed job, and what `--error-format
 * json` prints.
 */
export interface Problem {
  /** The value that is allowed. */ allowed?: number | null;
  /** The value that the request needs. */ asked?: number | null;
  /** Stable code, at least as exact as `type`. */ code: string;
  /** This occurrence in words. */ detail: string;
  /** All findings with their places. */ errors?: Array<Finding>;
  /** Name of the limit that was hit; its ending is the unit. */ limit?: string | null;
  /** A parameter and a value of it that would pass. */ remedy?: Record<string, number> | null;
  /** The request's id, as in the log and in `X-Request-Id`. */ request_id?: string | null;
  /** Seconds after which to try again. */ retry_after?: number | null;
  /** The HTTP status. */ status: number;
  /** The kind in words. */ title: string;
  /** Address of the kind of problem. */ type: ProblemKind;
}

/** The kinds of problem, one per `/problems/` address. */
export type ProblemKind = "/problems/malformed-json" | "/problems/bad-request" | "/problems/unauthenticated" | "/problems/forbidden" | "/problems/not-found" | "/problems/method-not-allowed" | "/problems/not-acceptable" | "/problems/request-timeout" | "/problems/idempotency-in-progress" | "/problems/state-conflict" | "/problems/result-expired" | "/problems/body-too-large" | "/problems/unsupported-media" | "/problems/range" | "/problems/invalid-model" | "/problems/invalid-file" | "/problems/idempotency-mismatch" | "/problems/precondition-failed" | "/problems/unreachable" | "/problems/limit" | "/problems/too-many-jobs" | "/problems/rate-limited" | "/problems/cancelled" | "/problems/interrupted" | "/problems/internal" | "/problems/input-output" | "/problems/unavailable" | "/problems/misdirected" | "/problems/shutting-down" | "/problems/timeout" | "/problems/usage" | "/problems/check-failed" | "/problems/service-unreachable";

/** A kind of problem. */
export interface ProblemPage {
  /** The exit code of commands that end with it. */ exit_code: number;
  /** The HTTP status of answers with it. */ status: number;
  /** The kind in words. */ title: string;
  /** Its address, as in `type`. */ type: ProblemKind;
}

/** The numbers of a process. */
export interface Profile {
  /** The name of the process. */ name: string;
  /** Its numbers. */ quantities: Array<Quantity>;
  /** What people call it. */ title: string;
}

/** The profiles. */
export interface ProfilePage {
  /** The profiles, sorted by name. */ items: Array<Profile>;
}

/** What a slicer will ask or suffer from. */
export interface Prompt {
  /** Stable code. */ code: string;
  /** What, in words, with the way out. */ message: string;
}

/** A number of a process. */
export interface Quantity {
  /** How. */ kind: Kind;
  /** The most that is seen. */ max?: number | null;
  /** The least that is seen. */ min?: number | null;
  /** Its name. */ name: string;
  /** When it holds. */ remark?: string;
  /** Where it comes from. */ source: string;
  /** The unit; empty for numbers without one. */ unit: string;
  /** The default. */ value: number;
}

/**
 * r = max(least_mm, first_mm ratio^k) for cells that leave the recursion of the part's root cells at level k,
 * the number of transitions taken within it; least_mm for the limit of the recursion itself.
 */
export interface RadiusByLevel {
  /** The radius at level 0, above zero. */ first_mm: number;
  /** No radius is less: above zero. */ least_mm: number;
  /** From one level to the next: between 0 and 1. */ ratio: number;
}

/** Two products of a state's operators and embeddings that are equal. */
export interface Relation {
  /** The two products. */ equal: Array<Side>;
  /** Name of the state. */ state: string;
}

/** One remark about a model. */
export interface Remark {
  /** Stable code. */ code: string;
  /** Column of the value, from 1. */ column?: number | null;
  /** Line of the value, from 1. */ line?: number | null;
  /** What, in words, with the values. */ message: string;
  /** JSON pointer into the model document. */ pointer: string;
  /** How much it matters. */ severity: Severity;
}

/**
 * What a repair did to an input that is a mesh. No point of the surface was moved. All counts but that of the
 * crossings are 0 where the mesh was left as it is.
 */
export interface RepairStatement {
  /** Whether anything was done; if not, the mesh is used as it came. */ changed: boolean;
  /** Holes that were closed by triangles between their corners, of at most 64 edges each and a quarter of the surface's area together. */ closed_holes: number;
  /** Triangles that close them. None meets another one elsewhere than in common corners and edges. */ closing_triangles: number;
  /** Pairs of triangles that meet elsewhere than in common corners and edges. No repair changes them. */ crossings: number;
  /** Vertices that were doubled, so that parts that meet there only are not joined. */ doubled_vertices: number;
  /** Name of the input. */ input: string;
  /** Vertices that became one with another at the same place. */ joined_vertices: number;
  /** Edges around the longest of these holes. */ longest_hole_edges: number;
  /** Edges of four triangles or more, around which those were joined that bound the same wedge of material. */ parted_edges: number;
  /** Triangles with the corners of another that were taken away, and walls between pieces that fill the space on both sides. */ removed_copies: number;
  /** Triangles without area that were taken away; those across their longest edge were cut where that was needed. */ removed_flat_triangles: number;
  /** Shells within others whose triangles looked outward for the most part, and which were taken as voids. Where such a shell is material, take the union of both: a job of kind `intersect` with `"operation": "union"`, each shell an input of its own. */ shells_made_voids: number;
  /** Triangles that were turned so that the material is behind them: a shell within another is a void. */ turned_triangles: number;
}

/** A cell that the shape starts from. */
export interface RootCell {
  /** As many points as the state's dimension; null for one that is to be placed. */ control_points: Array<ControlPoint | null>;
  /** Name of the cell's state. */ state: string;
}

/**
 * Plane sections of the solid that is certified beside them: each lies between those of the solid's inner and
 * outer bounds. A plane at the height of a level face gives the section just above it.
 */
export interface SectionsStatement {
  /** The planes' unit normal. */ normal: Array<number>;
  /** The planes, in the order of the files. */ planes: Array<PlaneStatement>;
  /** The direction of first coordinates in the planes. */ u: Array<number>;
  /** The direction of second coordinates. */ v: Array<number>;
}

/** How much a remark matters. */
export type Severity = "error" | "warning";

/** A shape of one of the families. */
export type Shape = IfsShape | BcifsShape | BezierCurveShape | CornerCuttingShape | SubdivisionShape | BezierSurfaceShape | NurbsCurveShape | NurbsSurfaceShape | NurbsVolumeShape | CatmullRomShape | BetaSplineShape | FourPointShape | InterpolationShape | TensorShape | SumShape | MeshShape | TerrainShape | GroupShape;

/** A job document without `kind`, which the address says. */
export interface ShortOrder {
  /** Named models, for kinds of jobs with several. */ inputs?: Array<JobInput>;
  /** The version of the grammar: 1. */ lacuna: 1;
  /** What the job may use; the service's defaults when absent. */ limits?: JobLimits;
  /** The model, in full. */ model?: EmbeddedModel;
  /** The id of a stored model or of an uploaded mesh file. */ model_ref?: string;
  /** Names of the formats wanted, for example 3mf and stl. A measure makes none, but ply with thickness. */ outputs?: Array<"stl" | "3mf" | "glb" | "obj" | "ply" | "off" | "wrl" | "png" | "csv" | "svg" | "dxf">;
  /** How to do it. */ params: JobParams;
  /** For a service: the id of a job that is stopped once this one is accepted, because nobody wants it any more. */ supersedes?: string;
}

/**
 * The product T_i T_j ... b_m b_p ...: a child, a child of that child and so on, then a boundary of the last, a
 * boundary of that boundary and so on.
 */
export interface Side {
  /** Boundaries m, p, ...; none when absent. */ boundary?: Array<number>;
  /** Children i, j, ...; none when absent. */ path?: Array<number>;
}

/** How a solution was found. */
export type SolutionMethod = "exact" | "local";

/** The solutions of a model with unknowns. */
export interface SolutionSpace {
  /** Number of independent choices that the constraints leave: the number of parameters. */ degrees_of_freedom: number;
  /** Declared parameters that the constraints determine to another value than the document's. */ determined: Array<DeterminedParameter>;
  /** Every entry that was unknown or a parameter, in the document's order. */ entries: Array<SolvedEntry>;
  local?: LocalSolution | null;
  /** How it was found. */ method: SolutionMethod;
  /** The free parameters. */ parameters: Array<FreeParameter>;
  /** Largest violation of a constraint in the filled model. */ residual: number;
  /** `[lower, upper]` bounds of the joint spectral radius of the filled model, which converges if the upper is below 1; `null` for a bound that is not known, absent if the filled model is no automaton. */ spectral_radius?: Array<number | null> | null;
}

/** A solved model: the solution space, and the model document for the chosen values. */
export type SolveReport = unknown;

/**
 * A model with unknown entries, and the values chosen for what its constraints leave free. Exactly one of model
 * and model_ref is given.
 */
export interface SolveRequest {
  /** The version of the grammar: 1. */ lacuna?: 1;
  /** The model, in full. */ model?: EmbeddedModel;
  /** The id of a stored model or of an uploaded mesh file. */ model_ref?: string;
  /** Values of free parameters by their names; those that are absent keep the value that the solver chooses. */ values?: Record<string, number>;
}

/** An entry that was unknown or a parameter: constant + sum of coefficients times parameters. */
export interface SolvedEntry {
  /** Coefficients by the name of the free parameter, none of them 0; absent together with `constant`. */ coefficients?: Record<string, ExactNumber> | null;
  constant?: ExactNumber | null;
  /** What it is called. */ name: string;
  /** JSON pointer into the model document. Coordinates of control points with weights are multiplied by the weight. */ pointer: string;
  /** Its value in the filled model. */ value: number;
}

/**
 * A solid in parts. Counts beside it are those of all parts together; its bounds are those of the solid before
 * it was split, and hold for the parts but for pegs and sockets.
 */
export interface SplitStatement {
  /** Where planes across x, y and z cut. */ cuts_mm: Array<Array<number>>;
  /** Keys that were placed, each a peg and a socket. */ keys: number;
  /** The parts. */ parts: Array<PartStatement>;
  /** Volume of one peg beyond its part. */ peg_volume_mm3: number;
  /** Volume of one socket. */ socket_volume_mm3: number;
  /** The build volume, if the parts had to fit one. */ volume_mm?: Array<number> | null;
  /** Volume that the mesh of the whole solid enclosed. */ whole_volume_mm3: number;
}

/** How the topology depends on the radius. Between the radii listed it is proven to stay the same. */
export interface StabilityStatement {
  above?: CriticalRadiusStatement | null;
  below?: CriticalRadiusStatement | null;
  /** All of them, in ascending order. */ critical: Array<CriticalRadiusStatement>;
  examined_mm: Array<number>;
  one_piece_mm: Array<number>;
}

/** A kind of cell. */
export interface State {
  /** The cell's boundary cells, in order. */ boundaries?: Array<Boundary>;
  /** The topological kind of the cell. */ cell: "vertex" | "edge" | "face" | "volume";
  /** The number of control points. */ dimension: number;
  /** The state's name, unique in the model. */ name: string;
  /** How the cell subdivides. */ transitions: Array<Transition>;
}

/** How far a running job has come. */
export interface Step {
  /** The error bound, in mm, that is proven of what has been made so far; absent as long as none is. At the end it is the certificate's `achieved_bound_mm`. */ bound_mm?: number | null;
  /** Triangles or cells made so far, by phase. */ count: number;
  /** Share of the phase that is done, in [0, 1]. */ fraction: number;
  /** `validate`, `refine`, `dilate`, `stitch`, `verify`, `combine`, `intersect`, `compare`, `section`, `stability`, `certify` or `write`. */ phase: string;
}

/** The limit surface of a subdivision scheme on a polygon mesh that is a manifold, with or without boundary. */
export interface SubdivisionShape {
  /** What happens at vertices of the boundary that belong to one face alone: the boundary is smooth there, or passes through them. */ boundary?: "smooth" | "sharp_corners";
  /** Masks of one's own, by region of faces; with doo_sabin only. */ coefficients?: Array<Coefficients>;
  /** Sharp vertices; not with doo_sabin. */ corners?: Array<Corner>;
  /** Sharp edges; not with doo_sabin. */ creases?: Array<Crease>;
  /** The family of the shape. */ family: "subdivision";
  /** The control mesh. */ mesh: ControlMesh;
  /** The scheme; loop takes triangles. */ scheme: "catmull_clark" | "doo_sabin" | "loop";
}

/** The surface u(s) + v(t): one curve moved along another. Its quadrilateral cells are parallelograms. */
export interface SumShape {
  /** The family of the shape. */ family: "sum";
  /** A curve in space. */ u: CurveShape;
  /** A curve in space. */ v: CurveShape;
}

/** The tensor product of two or three curve schemes on a net of control points. */
export interface TensorShape {
  /** control_points[i][j], or [i][j][k] with w; i along u. */ control_points: Array<Array<ControlPoint>> | Array<Array<Array<ControlPoint>>>;
  /** The family of the shape. */ family: "tensor";
  /** The first direction: a curve shape without control points. */ u: CurveScheme;
  /** The second direction. */ v: CurveScheme;
  /** The third direction, of a volume. */ w?: CurveScheme;
  /** Positive weights of the same shape, unless the points carry theirs. */ weights?: Array<Array<number>> | Array<Array<Array<number>>>;
}

/**
 * A surface of random midpoint displacement (Fournier, Fussell, Carpenter): triangles are cut in four `levels`
 * times, and every new midpoint moves along z.
 */
export interface TerrainShape {
  /** The family of the shape. */ family: "terrain";
  /** Rows of points to start from, two or more of two or more; or a triangle. */ grid?: Array<Array<Array<number>>>;
  /** How often triangles are cut in four. */ levels: number;
  /** Which of the terrains; 0 when absent. The same seed gives the same terrain. */ random_seed?: number;
  /** r: a midpoint that is new at level k moves by at most half the longest given edge times r^k. 0 is flat; 1/2 halves with the edges; below 1. */ roughness: number;
  /** The three corners to start from; or a grid. */ triangle?: Array<Array<number>>;
}

/**
 * Least thickness along the normals of the mesh that is measured, between faces that look at each other, whose
 * normals are opposite within 45 degrees and that have no corner in common: beside edges sharper than a right
 * angle every wall ends in nothing. For a dilation the mesh is the one that would be written, without
 * simplification, faces lower than twice its bound tell no direction, and those nearer to each other than thrice
 * the bound are taken for folds of one surface.
 */
export interface ThicknessStatement {
  gap?: LeastThicknessStatement | null;
  wall?: LeastThicknessStatement | null;
}

/** What happens to the topology when the radius grows. */
export type TopologyChange = "joins" | "closes" | "fills" | "unclear";

/** A child of a cell. */
export interface Transition {
  /** T: its columns are the child's control points in the parent's barycentric space. */ operator: Matrix;
  /** Name of the child's state. */ to: string;
}

/**
 * What is kept of a surface: the closed region of its parameter plane between an outer loop and inner loops. u
 * is the first direction of the control points and v the second; the domain is that of the knots, or [0, 1] for
 * Bezier surfaces. A loop is a closed chain of curves, either way round, within the domain; loops neither cross
 * nor touch themselves or each other. Ends of curves that miss each other by 1e-6 of the domain or less are
 * joined.
 */
export interface Trim {
  /** Loops around holes: inside the outer loop, and not inside each other. */ inner?: Array<Array<TrimCurve>>;
  /** The curves of the outer loop, in order; the border of the domain when absent. It may run along that border. */ outer?: Array<TrimCurve>;
}

/** A polynomial or rational Bezier curve in the parameter plane. */
export interface TrimBezier {
  /** The control points [u, v] or [u, v, w], in order. */ control_points: Array<TrimPoint>;
  /** The family of the shape. */ family: "bezier_curve";
  /** One positive weight per control point, unless the points carry theirs. */ weights?: Array<number>;
}

/** A curve in the parameter plane. */
export type TrimCurve = TrimPolyline | TrimBezier | TrimNurbs;

/** A polynomial or rational spline in the parameter plane. */
export interface TrimNurbs {
  /** The control points [u, v] or [u, v, w], in order. */ control_points: Array<TrimPoint>;
  /** The degree d, from 1 to 9. */ degree: number;
  /** The family of the shape. */ family: "nurbs_curve";
  /** The full knot vector: as many as control points, plus d + 1; not decreasing, multiplicities up to d + 1. The curve is defined from knot d to knot n, n being the number of control points. */ knots: Array<number>;
  /** One positive weight per control point, unless the points carry theirs. */ weights?: Array<number>;
}

/**
 * A parameter [u, v], or [u, v, w] with a positive weight w (1 when absent). Parameters have no unit and are not
 * multiplied by w.
 */
export type TrimPoint = Array<number>;

/** Segments between successive parameters. */
export interface TrimPolyline {
  /** The family of the shape. */ family: "polyline";
  /** Parameters [u, v], in order. */ points: Array<Array<number>>;
}

/** What `validate` says of a model. */
export interface ValidationReport {
  /** Largest violation of a constraint. */ constraint_residual?: number | null;
  /** Degrees of freedom of the unknown operators: 0 when none is unknown, absent when they could not be found. */ degrees_of_freedom?: number | null;
  /** What is wrong or odd, with places. */ diagnostics: Array<Remark>;
  /** `[lower, upper]` bounds of the joint spectral radius; `null` for a bound that is not known. */ spectral_radius?: Array<number | null> | null;
  /** Number of states of the automaton, once the document is legal. */ states?: number | null;
  /** Whether the model can be evaluated. */ valid: boolean;
}

/** Which program answers. */
export interface Version {
  /** The version of the contract, the `v` of the addresses. */ api: string;
  /** `lacuna`. */ name: string;
  /** The version of the service and of the kernel in it. */ version: string;
}

/** How a volume was found. */
export type VolumeMethod = "trilinear_forms";

/** On which side of a closed surface its wall is. */
export type WallSide = "inward" | "outward";

/** A wall along the surface of a solid M that is written as a part of it. */
export interface WallStatement {
  /** Volume of the hollow in the mesh as written: what an inward wall saves. */ hollow_volume_mm3?: number | null;
  reached_mm: Array<number>;
  /** On which side of M's surface. */ side: WallSide;
  /** Volume that M's mesh encloses. */ solid_volume_mm3: number;
  /** The thickness that was asked. */ thickness_mm: number;
}

/** Exactly one of these, in mm whatever the unit of the model. */
export interface With {
  /** Its centre and its radius: with all points within. */ ball?: Array<number>;
  /** Its lower and its upper corner: with all points within. */ box?: Array<number>;
  /** A point of it, and its direction of any length. */ line?: Array<number>;
  /** Its normal of any length, and its distance from the origin along that. */ plane?: Array<number>;
  /** x, y, z: does it belong to the shape? */ point?: Array<number>;
  /** Where it begins, and its direction of any length. */ ray?: Array<number>;
  /** Its two ends. */ segment?: Array<number>;
  /** true: the shape itself. Where does it come near itself although no boundary that the model declares joins it there? */ self?: true;
}
