// The exact parts of the judge, called from judge.py: distances between a mesh and the input, windings, and crossings.
// Nothing here is shared with the kernel: a bounding volume hierarchy in double precision, and predicates that fall back
// on exact expansions (Shewchuk, Adaptive Precision Floating-Point Arithmetic, 1997) where the sign is in doubt.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

namespace {

constexpr double FAR = std::numeric_limits<double>::infinity();

struct Vec {
    double x, y, z;
    double operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
};
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

using Simplex = std::array<Vec, 3>; // a segment repeats its last point, a point is repeated three times

// ------------------------------------------------------------------------------------------- distances (squared)

double point_segment(Vec p, Vec a, Vec b) {
    Vec direction = b - a;
    double length = dot(direction, direction);
    double t = length > 0 ? std::clamp(dot(p - a, direction) / length, 0.0, 1.0) : 0.0;
    Vec difference = p - (a + t * direction);
    return dot(difference, difference);
}

double point_triangle(Vec p, const Simplex& t) {
    Vec normal = cross(t[1] - t[0], t[2] - t[0]);
    double area = dot(normal, normal);
    if (area > 0) {
        bool within = true;
        for (int i = 0; i < 3 && within; i++) within = dot(cross(t[(i + 1) % 3] - t[i], p - t[i]), normal) >= 0;
        if (within) {
            double height = dot(p - t[0], normal);
            return height * height / area;
        }
    }
    return std::min({point_segment(p, t[0], t[1]), point_segment(p, t[1], t[2]), point_segment(p, t[2], t[0])});
}

// The least distance of two segments is taken at an end of one of them or at the common perpendicular.
double segment_segment(Vec a, Vec b, Vec c, Vec d) {
    double least = std::min({point_segment(a, c, d), point_segment(b, c, d), point_segment(c, a, b), point_segment(d, a, b)});
    Vec u = b - a, v = d - c, w = a - c, n = cross(u, v);
    double nn = dot(n, n);
    if (nn > 1e-24 * dot(u, u) * dot(v, v)) {
        double s = dot(cross(v, w), n) / nn, t = dot(cross(u, w), n) / nn;
        if (s > 0 && s < 1 && t > 0 && t < 1) {
            double height = dot(w, n);
            least = std::min(least, height * height / nn);
        }
    }
    return least;
}

bool pierces(Vec a, Vec b, const Simplex& t) {
    Vec normal = cross(t[1] - t[0], t[2] - t[0]);
    double from = dot(a - t[0], normal), to = dot(b - t[0], normal);
    if ((from > 0) == (to > 0)) return false;
    Vec at = a + (from / (from - to)) * (b - a);
    for (int i = 0; i < 3; i++)
        if (dot(cross(t[(i + 1) % 3] - t[i], at - t[i]), normal) < 0) return false;
    return true;
}

double triangle_simplex(const Simplex& t, const Simplex& site, int kind) {
    double least = point_triangle(site[0], t);
    if (kind == 1) return least;
    for (int i = 1; i < kind; i++) least = std::min(least, point_triangle(site[i], t));
    for (int e = 0; e < (kind == 2 ? 1 : 3); e++) {
        Vec a = site[e], b = site[(e + 1) % 3];
        for (int i = 0; i < 3; i++) least = std::min(least, segment_segment(a, b, t[i], t[(i + 1) % 3]));
        if (pierces(a, b, t)) return 0;
    }
    if (kind == 3)
        for (int i = 0; i < 3; i++) {
            least = std::min(least, point_triangle(t[i], site));
            if (pierces(t[i], t[(i + 1) % 3], site)) return 0;
        }
    return least;
}

// -------------------------------------------------------------------------------------------------- the hierarchy

struct Box {
    double low[3] = {FAR, FAR, FAR}, high[3] = {-FAR, -FAR, -FAR};
    void add(Vec p) {
        for (int a = 0; a < 3; a++) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
    }
    void add(const Simplex& s) {
        for (Vec p : s) add(p);
    }
    double distance(const Box& other) const { // squared
        double sum = 0;
        for (int a = 0; a < 3; a++) {
            double gap = std::max({low[a] - other.high[a], other.low[a] - high[a], 0.0});
            sum += gap * gap;
        }
        return sum;
    }
    bool meets(const Box& other) const {
        for (int a = 0; a < 3; a++)
            if (low[a] > other.high[a] || other.low[a] > high[a]) return false;
        return true;
    }
};

struct Hierarchy {
    struct Node {
        Box box;
        int64_t first, count; // count 0: the children are `first` and `first + 1`
    };
    std::vector<Node> nodes;
    std::vector<int64_t> order;
    std::vector<Simplex> items;
    int kind;

    Hierarchy(const double* vertices, const int32_t* cells, int64_t count, int corners) : order(count), items(count), kind(corners) {
        auto vertex = [&](int32_t i) { return Vec{vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]}; };
        for (int64_t i = 0; i < count; i++)
            for (int k = 0; k < 3; k++) items[i][k] = vertex(cells[corners * i + std::min(k, corners - 1)]);
        std::iota(order.begin(), order.end(), 0);
        nodes.push_back({});
        split(0, 0, count);
    }

    void split(size_t node, int64_t begin, int64_t end) {
        Box box, centres;
        for (int64_t i = begin; i < end; i++) {
            const Simplex& s = items[order[i]];
            box.add(s);
            centres.add(1.0 / 3 * (s[0] + s[1] + s[2]));
        }
        nodes[node] = {box, begin, end - begin};
        if (end - begin <= 4) return;
        int axis = 0;
        for (int a = 1; a < 3; a++)
            if (centres.high[a] - centres.low[a] > centres.high[axis] - centres.low[axis]) axis = a;
        auto key = [&](int64_t i) { return items[i][0][axis] + items[i][1][axis] + items[i][2][axis]; };
        int64_t middle = (begin + end) / 2;
        std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end,
                         [&](int64_t i, int64_t j) { return key(i) < key(j); });
        size_t child = nodes.size();
        nodes[node].first = child, nodes[node].count = 0;
        nodes.resize(child + 2);
        split(child, begin, middle);
        split(child + 1, middle, end);
    }

    // Calls `visit(item)` for every item whose box lies within `sqrt(limit)` of the query, near ones first; `visit` may lower the limit.
    template <class Visit> void near(const Box& query, double& limit, Visit visit) const {
        std::pair<size_t, double> stack[128];
        int top = 0;
        stack[top++] = {0, nodes[0].box.distance(query)};
        while (top > 0) {
            auto [index, distance] = stack[--top];
            if (distance >= limit) continue;
            const Node& node = nodes[index];
            for (int64_t i = 0; i < node.count; i++) visit(order[node.first + i]);
            if (node.count > 0) continue;
            size_t left = node.first, right = left + 1;
            double to_left = nodes[left].box.distance(query), to_right = nodes[right].box.distance(query);
            if (to_left < to_right) std::swap(left, right), std::swap(to_left, to_right);
            stack[top++] = {left, to_left};
            stack[top++] = {right, to_right};
        }
    }

    double from_item(Vec p, int64_t item) const {
        const Simplex& s = items[item];
        if (kind == 3) return point_triangle(p, s);
        return point_segment(p, s[0], s[1]);
    }

    double from(Vec p, int64_t* nearest = nullptr) const { // squared
        Box query;
        query.add(p);
        double least = FAR;
        near(query, least, [&](int64_t i) {
            double d = from_item(p, i);
            if (d < least) {
                least = d;
                if (nearest) *nearest = i;
            }
        });
        return least;
    }
};

struct Mesh {
    const double* vertices;
    const int32_t* triangles;
    Vec vertex(int64_t i) const { return {vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]}; }
    Simplex triangle(int64_t i) const {
        return {vertex(triangles[3 * i]), vertex(triangles[3 * i + 1]), vertex(triangles[3 * i + 2])};
    }
};

// Two halves across the longest edge.
std::array<Simplex, 2> halves(const Simplex& t) {
    int longest = 0;
    double length = -1;
    for (int i = 0; i < 3; i++) {
        Vec e = t[(i + 1) % 3] - t[i];
        if (dot(e, e) > length) length = dot(e, e), longest = i;
    }
    Vec a = t[longest], b = t[(longest + 1) % 3], c = t[(longest + 2) % 3], m = 0.5 * (a + b);
    return {Simplex{a, m, c}, Simplex{m, b, c}};
}

double size(const Simplex& t) {
    double most = 0;
    for (int i = 0; i < 3; i++) {
        Vec e = t[(i + 1) % 3] - t[i];
        most = std::max(most, dot(e, e));
    }
    return std::sqrt(most);
}

struct Extreme {
    double value;
    Vec place;
};

// The greatest distance of a point of the triangle from the input, if above `known + accuracy`. The distance from one site is
// convex, so its greatest value on a triangle is at a corner: every site gives an upper bound of the distance from the input.
void greatest(const Hierarchy& sites, Simplex whole, double accuracy, Extreme& known) {
    std::vector<Simplex> open = {whole};
    while (!open.empty()) {
        Simplex t = open.back();
        open.pop_back();
        Vec centre = 1.0 / 3 * (t[0] + t[1] + t[2]);
        double bound = FAR;
        for (Vec p : {centre, t[0], t[1], t[2]}) {
            int64_t site = 0;
            double d = std::sqrt(sites.from(p, &site));
            if (d > known.value) known = {d, p};
            double corners = 0;
            for (Vec q : t) corners = std::max(corners, sites.from_item(q, site));
            bound = std::min(bound, std::sqrt(corners));
            if (bound <= known.value + accuracy) break;
        }
        if (bound <= known.value + accuracy || size(t) < accuracy) continue;
        for (const Simplex& half : halves(t)) open.push_back(half);
    }
}

// The least distance between the triangle and the input, if below what is known; exact up to rounding. Long triangles are
// halved only to keep their boxes tight.
void least(const Hierarchy& sites, Simplex whole, double piece, Extreme& known) {
    std::vector<Simplex> open = {whole};
    while (!open.empty()) {
        Simplex t = open.back();
        open.pop_back();
        if (size(t) > piece) {
            for (const Simplex& half : halves(t)) open.push_back(half);
            continue;
        }
        Box box;
        box.add(t);
        double limit = known.value * known.value;
        sites.near(box, limit, [&](int64_t i) {
            Box item;
            item.add(sites.items[i]);
            if (item.distance(box) >= limit) return;
            double d = triangle_simplex(t, sites.items[i], sites.kind);
            if (d < limit) limit = d, known = {std::sqrt(d), 1.0 / 3 * (t[0] + t[1] + t[2])};
        });
    }
}

// -------------------------------------------------------------------------------------------------- exact predicates

// A sum of doubles that do not overlap, least first; exact.
struct Expansion {
    std::vector<double> terms;
    int sign() const { return terms.empty() ? 0 : terms.back() > 0 ? 1 : -1; }
};
Expansion difference(double a, double b) {
    double s = a - b, v = a - s, error = (a - (s + v)) + (v - b);
    Expansion e;
    if (error != 0) e.terms.push_back(error);
    if (s != 0) e.terms.push_back(s);
    return e;
}
void grow(std::vector<double>& terms, double value) {
    size_t kept = 0;
    for (double term : terms) {
        double s = value + term, v = s - value, error = (value - (s - v)) + (term - v);
        if (error != 0) terms[kept++] = error;
        value = s;
    }
    terms.resize(kept);
    if (value != 0) terms.push_back(value);
}
Expansion sum(Expansion a, const Expansion& b, double factor = 1) { // factor is 1 or -1
    for (double term : b.terms) grow(a.terms, factor * term);
    return a;
}
Expansion product(const Expansion& a, const Expansion& b) {
    Expansion result;
    for (double x : a.terms)
        for (double y : b.terms) {
            double high = x * y, low = std::fma(x, y, -high);
            grow(result.terms, low);
            grow(result.terms, high);
        }
    return result;
}

// Sign of the area of (a, b, c) seen along an axis.
int turn(Vec a, Vec b, Vec c, int axis) {
    int i = (axis + 1) % 3, j = (axis + 2) % 3;
    double left = (a[i] - c[i]) * (b[j] - c[j]), right = (a[j] - c[j]) * (b[i] - c[i]), value = left - right;
    if (std::abs(value) > 4e-15 * (std::abs(left) + std::abs(right))) return value > 0 ? 1 : -1;
    return sum(product(difference(a[i], c[i]), difference(b[j], c[j])), product(difference(a[j], c[j]), difference(b[i], c[i])), -1).sign();
}

// Sign of the volume of (a, b, c, d).
int side(Vec a, Vec b, Vec c, Vec d) {
    Vec u = a - d, v = b - d, w = c - d;
    double value = dot(u, cross(v, w));
    double size = 0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        size += std::abs(u[i]) * (std::abs(v[j] * w[k]) + std::abs(v[k] * w[j]));
    }
    if (std::abs(value) > 2e-15 * size) return value > 0 ? 1 : -1;
    Expansion total, rows[3][3];
    const Vec points[3] = {a, b, c};
    for (int p = 0; p < 3; p++)
        for (int i = 0; i < 3; i++) rows[p][i] = difference(points[p][i], d[i]);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        Expansion minor = sum(product(rows[1][j], rows[2][k]), product(rows[1][k], rows[2][j]), -1);
        total = sum(total, product(rows[0][i], minor));
    }
    return total.sign();
}

// The axis along which the triangle is seen best; its exact turn there is not 0 unless it is degenerate.
int view(const Simplex& t) {
    Vec n = cross(t[1] - t[0], t[2] - t[0]);
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (std::abs(n[a]) > std::abs(n[axis])) axis = a;
    return axis;
}

bool segments_meet(Vec a, Vec b, Vec c, Vec d, int axis) { // in one plane, closed
    int s = turn(a, b, c, axis), t = turn(a, b, d, axis), u = turn(c, d, a, axis), v = turn(c, d, b, axis);
    if (s == 0 && t == 0 && u == 0 && v == 0) {
        for (int i : {(axis + 1) % 3, (axis + 2) % 3})
            if (std::max(a[i], b[i]) < std::min(c[i], d[i]) || std::max(c[i], d[i]) < std::min(a[i], b[i])) return false;
        return true;
    }
    return s * t <= 0 && u * v <= 0;
}

// Whether the closed segment meets the closed triangle.
bool meets(Vec p, Vec q, const Simplex& t) {
    int from = side(t[0], t[1], t[2], p), to = side(t[0], t[1], t[2], q);
    if (from * to > 0) return false;
    if (from != 0 || to != 0) {
        int low = 0, high = 0;
        for (int i = 0; i < 3; i++) {
            int s = side(p, q, t[i], t[(i + 1) % 3]);
            low |= s < 0, high |= s > 0;
        }
        return !(low && high);
    }
    int axis = view(t), turns = turn(t[0], t[1], t[2], axis);
    for (int i = 0; i < 3; i++)
        if (segments_meet(p, q, t[i], t[(i + 1) % 3], axis)) return true;
    for (int i = 0; i < 3; i++)
        if (turn(t[i], t[(i + 1) % 3], p, axis) * turns < 0) return false;
    return true;
}

// Whether two triangles of a mesh meet elsewhere than in the vertices and the edge that they share. Two that share one vertex
// meet in a convex set that leaves it, and it ends on the edge opposite to that vertex in one of the two.
bool cross_each_other(const Mesh& mesh, int64_t i, int64_t j) {
    const int32_t *f = mesh.triangles + 3 * i, *g = mesh.triangles + 3 * j;
    int shared = 0, alone_f = 0, alone_g = 0;
    for (int a = 0; a < 3; a++)
        if (std::find(g, g + 3, f[a]) != g + 3) shared++;
    Simplex t = mesh.triangle(i), u = mesh.triangle(j);
    if (shared == 3) return true;
    if (shared == 0) {
        for (int a = 0; a < 3; a++)
            if (meets(t[a], t[(a + 1) % 3], u) || meets(u[a], u[(a + 1) % 3], t)) return true;
        return false;
    }
    for (int a = 0; a < 3; a++) {
        bool in_g = std::find(g, g + 3, f[a]) != g + 3, in_f = std::find(f, f + 3, g[a]) != f + 3;
        if (in_g == (shared == 1)) alone_f = a; // the shared vertex, or the one that is not shared
        if (in_f == (shared == 1)) alone_g = a;
    }
    Vec a = t[(alone_f + 1) % 3], b = t[(alone_f + 2) % 3];
    if (shared == 1) return meets(a, b, u) || meets(u[(alone_g + 1) % 3], u[(alone_g + 2) % 3], t);
    if (side(a, b, t[alone_f], u[alone_g]) != 0) return false;
    int axis = view(t);
    return turn(a, b, t[alone_f], axis) * turn(a, b, u[alone_g], axis) >= 0; // folded onto each other
}

} // namespace

extern "C" {

void* hierarchy_new(const double* vertices, const int32_t* cells, int64_t count, int corners) {
    return new Hierarchy(vertices, cells, count, corners);
}
void hierarchy_free(void* handle) { delete static_cast<Hierarchy*>(handle); }

void distances(void* handle, const double* points, int64_t count, double* out) {
    auto& sites = *static_cast<Hierarchy*>(handle);
#pragma omp parallel for schedule(dynamic, 1024)
    for (int64_t i = 0; i < count; i++) out[i] = std::sqrt(sites.from({points[3 * i], points[3 * i + 1], points[3 * i + 2]}));
}

// The least and the greatest distance of the mesh's points from the input, each with its place: out = (least, x, y, z, greatest, x, y, z).
void extremes(void* handle, const double* vertices, const int32_t* triangles, int64_t count, double piece, double accuracy, double* out) {
    auto& sites = *static_cast<Hierarchy*>(handle);
    Mesh mesh{vertices, triangles};
    Extreme low{FAR, {}}, high{-1, {}};
#pragma omp parallel
    {
        Extreme mine{FAR, {}}, most{-1, {}};
#pragma omp for schedule(dynamic, 1024)
        for (int64_t i = 0; i < count; i++) { // corners and centroids first: good limits for the search
            Simplex t = mesh.triangle(i);
            Vec centre = 1.0 / 3 * (t[0] + t[1] + t[2]);
            double d = std::sqrt(sites.from(centre)), c = std::sqrt(sites.from(t[0]));
            if (d < mine.value) mine = {d, centre};
            if (c < mine.value) mine = {c, t[0]};
            if (d > most.value) most = {d, centre};
            if (c > most.value) most = {c, t[0]};
        }
#pragma omp critical
        {
            if (mine.value < low.value) low = mine;
            if (most.value > high.value) high = most;
        }
#pragma omp barrier
        mine = low, most = high;
#pragma omp barrier
#pragma omp for schedule(dynamic, 256)
        for (int64_t i = 0; i < count; i++) {
            least(sites, mesh.triangle(i), piece, mine);
            greatest(sites, mesh.triangle(i), accuracy, most);
        }
#pragma omp critical
        {
            if (mine.value < low.value) low = mine;
            if (most.value > high.value) high = most;
        }
    }
    const double values[8] = {low.value, low.place.x, low.place.y, low.place.z, high.value, high.place.x, high.place.y, high.place.z};
    std::copy(values, values + 8, out);
}

// How often the mesh winds around each point: signed crossings of a ray. `direction` is generic, so that no ray meets an edge in practice.
void windings(void* handle, const double* points, int64_t count, const double* direction, int32_t* out) {
    auto& mesh = *static_cast<Hierarchy*>(handle);
    Vec ray{direction[0], direction[1], direction[2]};
#pragma omp parallel for schedule(dynamic, 64)
    for (int64_t i = 0; i < count; i++) {
        Vec p{points[3 * i], points[3 * i + 1], points[3 * i + 2]};
        int32_t total = 0;
        std::vector<size_t> stack = {0};
        while (!stack.empty()) {
            const auto& node = mesh.nodes[stack.back()];
            stack.pop_back();
            double from = 0, to = FAR;
            for (int a = 0; a < 3; a++) {
                double s = (node.box.low[a] - p[a]) / ray[a], t = (node.box.high[a] - p[a]) / ray[a];
                from = std::max(from, std::min(s, t)), to = std::min(to, std::max(s, t));
            }
            if (from > to * (1 + 1e-12) + 1e-12) continue;
            if (node.count == 0) {
                stack.push_back(node.first);
                stack.push_back(node.first + 1);
            }
            for (int64_t k = 0; k < node.count; k++) {
                const Simplex& t = mesh.items[mesh.order[node.first + k]];
                Vec normal = cross(t[1] - t[0], t[2] - t[0]);
                double slope = dot(ray, normal);
                if (slope == 0 || dot(t[0] - p, normal) / slope < 0) continue;
                int signs[3];
                for (int e = 0; e < 3; e++) signs[e] = side(t[e], t[(e + 1) % 3], p + ray, p);
                if (signs[0] == signs[1] && signs[1] == signs[2]) total += slope > 0 ? 1 : -1;
            }
        }
        out[i] = total;
    }
}

// The number of pairs of triangles that meet where a mesh must not; the first `room` of them go to `pairs`.
int64_t crossings(void* handle, const double* vertices, const int32_t* triangles, int64_t count, int64_t* pairs, int64_t room) {
    auto& hierarchy = *static_cast<Hierarchy*>(handle);
    Mesh mesh{vertices, triangles};
    std::atomic<int64_t> found{0};
#pragma omp parallel for schedule(dynamic, 256)
    for (int64_t i = 0; i < count; i++) {
        Box box;
        box.add(mesh.triangle(i));
        std::vector<size_t> stack = {0};
        while (!stack.empty()) {
            const auto& node = hierarchy.nodes[stack.back()];
            stack.pop_back();
            if (!node.box.meets(box)) continue;
            if (node.count == 0) {
                stack.push_back(node.first);
                stack.push_back(node.first + 1);
            }
            for (int64_t k = 0; k < node.count; k++) {
                int64_t j = hierarchy.order[node.first + k];
                if (j <= i) continue;
                Box other;
                other.add(hierarchy.items[j]);
                if (!other.meets(box) || !cross_each_other(mesh, i, j)) continue;
                int64_t place = found++;
                if (place < room) pairs[2 * place] = i, pairs[2 * place + 1] = j;
            }
        }
    }
    return found;
}
}
