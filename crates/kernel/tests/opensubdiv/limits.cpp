// Limit points and normals of OpenSubdiv 3.5, in double precision.
// stdin: scheme (catmark, loop), sharp corners (0, 1), level; vertices; faces; creases (a b sharpness); corners (v sharpness);
// each list after its length. stdout: a line "x y z nx ny nz" for every vertex of the level. With the argument `time`: the
// CPU seconds from the cage to the level's limit points and quads, and its number of vertices.
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <string>
#include <vector>
using namespace OpenSubdiv;
struct Point {
  double p[3] = {0, 0, 0};
  void Clear(void * = nullptr) { p[0] = p[1] = p[2] = 0; }
  void AddWithWeight(const Point &other, double weight) {
    for (int axis = 0; axis < 3; axis++) p[axis] += weight * other.p[axis];
  }
};
int main(int arguments, char **) {
  std::string scheme;
  int corners, level, count;
  std::cin >> scheme >> corners >> level >> count;
  std::vector<Point> points(count);
  for (auto &point : points) std::cin >> point.p[0] >> point.p[1] >> point.p[2];
  std::cin >> count;
  std::vector<int> sizes(count), indices;
  for (auto &size : sizes) {
    std::cin >> size;
    for (int k = 0; k < size; k++) indices.push_back(0), std::cin >> indices.back();
  }
  std::cin >> count;
  std::vector<int> edges(2 * count);
  std::vector<float> sharp(count);
  for (int k = 0; k < count; k++) std::cin >> edges[2 * k] >> edges[2 * k + 1] >> sharp[k];
  std::cin >> count;
  std::vector<int> vertices(count);
  std::vector<float> vertex_sharp(count);
  for (int k = 0; k < count; k++) std::cin >> vertices[k] >> vertex_sharp[k];
  using Descriptor = Far::TopologyDescriptor;
  Descriptor d;
  d.numVertices = int(points.size());
  d.numFaces = int(sizes.size());
  d.numVertsPerFace = sizes.data();
  d.vertIndicesPerFace = indices.data();
  d.numCreases = int(sharp.size());
  d.creaseVertexIndexPairs = edges.data();
  d.creaseWeights = sharp.data();
  d.numCorners = int(vertices.size());
  d.cornerVertexIndices = vertices.data();
  d.cornerWeights = vertex_sharp.data();
  Sdc::Options options;
  options.SetVtxBoundaryInterpolation(corners ? Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER : Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  clock_t start = clock();
  auto type = scheme == "loop" ? Sdc::SCHEME_LOOP : Sdc::SCHEME_CATMARK;
  auto *refiner = Far::TopologyRefinerFactory<Descriptor>::Create(d, Far::TopologyRefinerFactory<Descriptor>::Options(type, options));
  if (!refiner) return 1;
  Far::TopologyRefiner::UniformOptions uniform(level);
  uniform.fullTopologyInLastLevel = true;
  refiner->RefineUniform(uniform);
  Far::PrimvarRefinerReal<double> primvar(*refiner);
  for (int l = 1; l <= level; l++) {
    std::vector<Point> next(refiner->GetLevel(l).GetNumVertices());
    primvar.Interpolate(l, points, next);
    points = next;
  }
  std::vector<Point> limit(points.size()), u, v;
  if (arguments > 1) {
    primvar.Limit(points, limit);
    auto last = refiner->GetLevel(level);
    std::vector<int> quads;
    for (int f = 0; f < last.GetNumFaces(); f++)
      for (int k = 0; k < 4; k++) quads.push_back(last.GetFaceVertices(f)[k]);
    printf("%.4f %d %d\n", double(clock() - start) / CLOCKS_PER_SEC, int(limit.size()), int(quads.size()));
    return 0;
  }
  u.resize(points.size());
  v.resize(points.size());
  primvar.Limit(points, limit, u, v);
  for (size_t k = 0; k < points.size(); k++) {
    double *a = u[k].p, *b = v[k].p;
    double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", limit[k].p[0], limit[k].p[1], limit[k].p[2], n[0] / length, n[1] / length, n[2] / length);
  }
}
