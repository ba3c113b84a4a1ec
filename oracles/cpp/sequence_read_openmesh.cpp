// Stage sequence.read by OpenMesh: its OBJ reader, its half-edge connectivity, its face areas and its boundary test.
//
// `seconds` includes the building of half-edges, which is how OpenMesh loads a mesh.
//
// Limits of OpenMesh 9.0, none of which this file works around:
// - the mesh holds doubles, but the OBJ reader parses every coordinate as float: areas, volumes and boxes are good to about
//   1e-7 relative, counts are exact;
// - it drops a vertex whose numbers overflow float, a face with an equal or missing vertex, and a face on a line continued with "\";
// - it adds a face that would make an edge non-manifold with three new vertices of its own.
// The last two would pass for wrong counts, so the file's own "v" and "f" lines are counted and a difference is an error.
// A polygon becomes the fan of triangles around its first vertex.

#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include <fstream>
#include <memory>
#include <sstream>

#include "wire.hpp"

struct Traits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    using Normal = OpenMesh::Vec3d;
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;

// What the file says: its vertices, and the triangles of its faces.
static std::pair<std::size_t, std::size_t> count_lines(const std::string& path) {
    std::ifstream file(path);
    std::size_t vertices = 0, triangles = 0;
    for (std::string line, word; std::getline(file, line);) {
        std::istringstream words(line);
        if (!(words >> word)) continue;
        if (word == "v") ++vertices;
        if (word != "f") continue;
        std::size_t corners = 0;
        while (words >> word) ++corners;
        if (corners < 3) throw std::runtime_error(path + " has a face of fewer than three vertices");
        triangles += corners - 2;
    }
    return {vertices, triangles};
}

static void measure(Mesh& mesh, wire::Integers& counts, wire::Reals& measures) {
    std::int64_t boundary = 0;
    for (const auto edge : mesh.edges()) boundary += mesh.is_boundary(edge);

    double area = 0, volume = 0;
    for (const auto face : mesh.faces()) {
        auto corner = mesh.cfv_begin(face);
        const Mesh::Point a = mesh.point(*corner++), b = mesh.point(*corner++), c = mesh.point(*corner);
        area += mesh.calc_face_area(face);
        volume += (a | (b % c)) / 6;
    }

    Mesh::Point least(std::numeric_limits<double>::infinity()), greatest = -least;
    for (const auto vertex : mesh.vertices()) {
        least.minimize(mesh.point(vertex));
        greatest.maximize(mesh.point(vertex));
    }

    counts.insert(counts.end(), {std::int64_t(mesh.n_vertices()), std::int64_t(mesh.n_faces()), boundary});
    measures.insert(measures.end(), {area, volume});
    measures.insert(measures.end(), least.begin(), least.end());
    measures.insert(measures.end(), greatest.begin(), greatest.end());
}

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "sequence.read") throw wire::Unsupported("OpenMesh answers sequence.read only");
    std::vector<std::string> paths;
    std::istringstream lines(wire::text(inputs, "paths"));
    for (std::string path; std::getline(lines, path);)
        if (!path.empty()) paths.push_back(path);

    auto meshes = std::make_shared<std::vector<Mesh>>();
    auto work = [=] {
        meshes->assign(paths.size(), Mesh());
        for (std::size_t i = 0; i < paths.size(); ++i)
            if (!OpenMesh::IO::read_mesh((*meshes)[i], paths[i])) throw std::runtime_error("OpenMesh cannot read " + paths[i]);
    };
    auto answer = [=] {
        wire::Integers counts;
        wire::Reals measures;
        for (std::size_t i = 0; i < paths.size(); ++i) {
            Mesh& mesh = (*meshes)[i];
            if (count_lines(paths[i]) != std::make_pair(mesh.n_vertices(), mesh.n_faces()))
                throw std::runtime_error("OpenMesh has dropped or doubled part of " + paths[i]);
            measure(mesh, counts, measures);
        }
        const std::uint64_t n = paths.size();
        return wire::Message{{"counts", {{n, 3}, counts}}, {"measures", {{n, 8}, measures}}};
    };
    return {work, answer};
}

int main() {
    return wire::serve("OpenMesh " + std::to_string(OM_GET_VER) + "." + std::to_string(OM_GET_MAJ) + ", GCC " __VERSION__, prepare);
}
