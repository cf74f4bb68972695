// OpenVDB: an unsigned narrow band around the input (points and segments go in as degenerate triangles), and its level set.
//   openvdb_offset IN.obj RADIUS VOXEL OUT.bin
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>

static double cpu() {
    timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

int main(int, char** arguments) {
    openvdb::initialize();
    const double radius = std::stod(arguments[2]), voxel = std::stod(arguments[3]);
    std::vector<openvdb::Vec3d> vertices;
    std::vector<openvdb::Vec3I> cells;
    std::ifstream file(arguments[1]);
    for (std::string line; std::getline(file, line);) {
        std::istringstream words(line);
        std::string kind;
        words >> kind;
        if (kind == "v") {
            openvdb::Vec3d v;
            words >> v[0] >> v[1] >> v[2];
            vertices.push_back(v);
        } else if (kind == "l" || kind == "f") {
            unsigned a, b, c;
            words >> a;
            if (!(words >> b)) b = a;
            if (!(words >> c)) c = b;
            cells.emplace_back(a - 1, b - 1, c - 1);
        }
    }
    const auto start = std::chrono::steady_clock::now();
    const double start_cpu = cpu();
    auto transform = openvdb::math::Transform::createLinearTransform(voxel);
    std::vector<openvdb::Vec3s> points;
    for (const auto& v : vertices) points.emplace_back(transform->worldToIndex(v));
    openvdb::tools::QuadAndTriangleDataAdapter<openvdb::Vec3s, openvdb::Vec3I> mesh(points, cells);
    const float band = float(radius / voxel + 2);
    auto grid = openvdb::tools::meshToVolume<openvdb::FloatGrid>(mesh, *transform, band, band, openvdb::tools::UNSIGNED_DISTANCE_FIELD);
    std::vector<openvdb::Vec3s> out;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*grid, out, triangles, quads, radius, 0);
    for (const auto& q : quads) {
        triangles.emplace_back(q[0], q[1], q[2]);
        triangles.emplace_back(q[0], q[2], q[3]);
    }
    const double used = cpu() - start_cpu;
    const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    std::ofstream result(arguments[4], std::ios::binary);
    const uint64_t counts[2] = {out.size(), triangles.size()};
    result.write(reinterpret_cast<const char*>(counts), sizeof counts);
    for (const auto& p : out) {
        const openvdb::Vec3d v(p);
        result.write(reinterpret_cast<const char*>(&v), sizeof v);
    }
    for (const auto& t : triangles) {
        const uint32_t corners[3] = {uint32_t(t[0]), uint32_t(t[1]), uint32_t(t[2])};
        result.write(reinterpret_cast<const char*>(corners), sizeof corners);
    }
    long peak = 0;
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind("VmHWM:", 0) == 0) peak = std::stol(line.substr(6));
    std::printf("{\"cpu\": %.4f, \"wall\": %.4f, \"peak_mb\": %.1f}\n", used, wall, peak / 1024.0);
}
