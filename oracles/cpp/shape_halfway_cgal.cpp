// Stage shape.halfway by CGAL: Surface_mesh_deformation with the energy SPOKES_AND_RIMS (Chao, Pinkall, Sanan, Schroeder 2010): for each vertex, the
// cotangent-weighted edges of its triangles against one rotation. At every step from `start` (see PROTOCOL.md) CGAL alternates positions and
// rotations `iterations` times; at the last, until `iterations` of them move no vertex by more than `still` of the diagonal, `most` at most, as such
// alternations end slowly. CGAL's own test, of the energy, ends much earlier.
//
// What it has not got is said: components without a handle, degenerate triangles (their cotangents have no bound), and surfaces that are no oriented
// manifolds.

#define CGAL_EIGEN3_ENABLED  // the default solver and the default rotations

#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_deformation.h>
#include <CGAL/version.h>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <array>
#include <memory>
#include <numeric>

#include "wire.hpp"

using Point = CGAL::Simple_cartesian<double>::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;
using Deformation = CGAL::Surface_mesh_deformation<Mesh, CGAL::Default, CGAL::Default, CGAL::SPOKES_AND_RIMS>;
using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr unsigned iterations = 10, most = 1000;
constexpr double still = 1e-5, turn = EIGEN_PI / 18, move = 0.1;

// Handles that move together: their centre on a line, their rotation by equal parts, the rest in proportion.
struct Grip {
    std::vector<int> members;  // columns of the handles
    Vector3d from, by;
    Matrix3Xd arms, rest;
    Eigen::AngleAxisd rotation;

    Grip(std::vector<int> columns, const Matrix3Xd& begin, const Matrix3Xd& end) : members(std::move(columns)) {
        arms = select(begin);
        Matrix3Xd ends = select(end);
        from = arms.rowwise().mean();
        by = ends.rowwise().mean() - from;
        ends.colwise() -= from + by;
        arms.colwise() -= from;
        Matrix3d product = ends * arms.transpose();
        product.diagonal().array() += 1e-9 * product.norm();  // the identity decides what the arms leave free
        const Eigen::JacobiSVD<Matrix3d> svd(product, Eigen::ComputeFullU | Eigen::ComputeFullV);
        const double side = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
        const Matrix3d nearest = svd.matrixU() * Vector3d(1, 1, side).asDiagonal() * svd.matrixV().transpose();
        rotation = nearest;
        rest = nearest.transpose() * ends - arms;
    }

    double steps(double diagonal) const { return std::max(rotation.angle() / turn, by.norm() / (move * diagonal)); }

    void place(double s, Matrix3Xd& positions) const {
        const Matrix3d part = Eigen::AngleAxisd(s * rotation.angle(), rotation.axis()).toRotationMatrix();
        for (std::size_t i = 0; i < members.size(); ++i) positions.col(members[i]) = from + s * by + part * (arms.col(i) + s * rest.col(i));
    }

private:
    Matrix3Xd select(const Matrix3Xd& all) const {
        Matrix3Xd some(3, members.size());
        for (std::size_t i = 0; i < members.size(); ++i) some.col(i) = all.col(members[i]);
        return some;
    }
};

struct Problem {
    Mesh rest;
    std::vector<int> handles;
    Matrix3Xd targets;
    std::vector<Grip> grips;
    double diagonal = 0;
    Mesh answer;

    // Made anew in every call, as CGAL deforms the mesh that it is given.
    void solve() {
        answer = rest;
        Deformation deformation(answer);
        deformation.insert_roi_vertices(vertices(answer).begin(), vertices(answer).end());
        for (int v : handles) deformation.insert_control_vertex(Mesh::Vertex_index(v));
        if (!deformation.preprocess()) throw std::runtime_error("CGAL cannot factor the system");
        const auto hold = [&](const Matrix3Xd& positions) {
            for (std::size_t h = 0; h < handles.size(); ++h)
                deformation.set_target_position(Mesh::Vertex_index(handles[h]), Point(positions(0, h), positions(1, h), positions(2, h)));
            deformation.deform(iterations, 0);
        };

        double steps = 1;
        for (const Grip& grip : grips) steps = std::max(steps, std::ceil(grip.steps(diagonal)));
        Matrix3Xd positions = targets;
        for (double step = 1; step < steps; ++step) {
            for (const Grip& grip : grips) grip.place(step / steps, positions);
            hold(positions);
        }
        hold(targets);
        for (unsigned done = 0; done < most; done += iterations) {
            const Mesh before = answer;
            deformation.deform(iterations, 0);
            double moved = 0;
            for (const auto v : answer.vertices())
                for (int axis = 0; axis < 3; ++axis) moved = std::max(moved, std::abs(answer.point(v)[axis] - before.point(v)[axis]));
            if (moved <= still * diagonal) return;
        }
    }
};

// The lowest vertex that edges of kept vertices join each vertex to.
static std::vector<int> joined(const wire::Integers& faces, const std::vector<char>& kept) {
    std::vector<int> parent(kept.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](int v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (std::size_t f = 0; f < faces.size(); f += 3)
        for (int corner = 0; corner < 3; ++corner) {
            const int a = int(faces[f + corner]), b = int(faces[f + (corner + 1) % 3]);
            if (kept[a] && kept[b]) {
                const int low = std::min(find(a), find(b)), high = std::max(find(a), find(b));
                parent[high] = low;
            }
        }
    for (std::size_t v = 0; v < parent.size(); ++v) parent[v] = find(int(v));
    return parent;
}

static Mesh build(const wire::Reals& positions, const wire::Integers& faces) {
    std::vector<Point> points;
    for (std::size_t v = 0; v < positions.size(); v += 3) points.emplace_back(positions[v], positions[v + 1], positions[v + 2]);
    std::vector<std::array<std::size_t, 3>> triangles;
    for (std::size_t f = 0; f < faces.size(); f += 3) {
        triangles.push_back({std::size_t(faces[f]), std::size_t(faces[f + 1]), std::size_t(faces[f + 2])});
        const Point &a = points[faces[f]], &b = points[faces[f + 1]], &c = points[faces[f + 2]];
        const double longest = std::max({CGAL::squared_distance(a, b), CGAL::squared_distance(b, c), CGAL::squared_distance(c, a)});
        if (2 * std::sqrt(CGAL::squared_area(a, b, c)) <= 1e-5 * longest)
            throw wire::Unsupported("a triangle of start is degenerate: its cotangents have no bound");
    }
    namespace PMP = CGAL::Polygon_mesh_processing;
    if (!PMP::is_polygon_soup_a_polygon_mesh(triangles)) throw wire::Unsupported("CGAL's mesh cannot hold a surface that is no oriented manifold");
    Mesh mesh;
    for (const Point& point : points) mesh.add_vertex(point);  // not polygon_soup_to_polygon_mesh, which drops vertices of no triangle
    for (const auto& [a, b, c] : triangles)
        if (mesh.add_face(Mesh::Vertex_index(a), Mesh::Vertex_index(b), Mesh::Vertex_index(c)) == Mesh::null_face())
            throw wire::Unsupported("CGAL's mesh cannot hold a surface that is no oriented manifold");
    return mesh;
}

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "shape.halfway") throw wire::Unsupported("CGAL answers shape.halfway only");
    const wire::Reals &start = wire::f64(inputs, "start", 2), &targets = wire::f64(inputs, "targets", 2);
    const wire::Integers &faces = wire::i64(inputs, "F", 2), &handles = wire::i64(inputs, "handles", 1);
    const std::uint64_t count = inputs.at("start").shape[0];
    const auto columns = [&](const char* name) { return inputs.at(name).shape[1]; };
    if (columns("start") != 3 || columns("F") != 3 || columns("targets") != 3 || targets.size() != 3 * handles.size())
        throw std::invalid_argument("start is (V,3), F (F,3), handles (H) and targets (H,3)");
    for (const wire::Integers* indices : {&faces, &handles})
        for (std::int64_t index : *indices)
            if (index < 0 || std::uint64_t(index) >= count) throw std::invalid_argument("a face or a handle names a vertex that is not there");

    auto problem = std::make_shared<Problem>();
    std::vector<char> held(count, 0), has_handle(count, 0);
    for (std::int64_t v : handles) {
        if (held[v]) throw std::invalid_argument("a vertex is a handle twice");
        held[v] = 1;
        problem->handles.push_back(int(v));
    }
    const std::vector<int> component = joined(faces, std::vector<char>(count, 1)), grip = joined(faces, held);
    for (int v : problem->handles) has_handle[component[v]] = 1;
    for (int label : component)
        if (!has_handle[label]) throw wire::Unsupported("a component has no handle: an as-rigid-as-possible deformation leaves it where it likes");
    problem->rest = build(start, faces);

    const Matrix3Xd all = Eigen::Map<const Matrix3Xd>(start.data(), 3, Eigen::Index(count));
    problem->targets = Eigen::Map<const Matrix3Xd>(targets.data(), 3, Eigen::Index(handles.size()));
    problem->diagonal = (all.rowwise().maxCoeff() - all.rowwise().minCoeff()).norm();
    Matrix3Xd begin(3, handles.size());
    std::map<int, std::vector<int>> members;
    for (std::size_t h = 0; h < handles.size(); ++h) {
        begin.col(Eigen::Index(h)) = all.col(handles[h]);
        members[grip[handles[h]]].push_back(int(h));
    }
    for (auto& [label, columns] : members) problem->grips.emplace_back(columns, begin, problem->targets);

    const auto answer = [=] {
        wire::Reals frame;
        for (const auto v : problem->answer.vertices())
            for (int axis = 0; axis < 3; ++axis) frame.push_back(problem->answer.point(v)[axis]);
        return wire::Message{{"frame", {{count, 3}, frame}}};
    };
    return {[=] { problem->solve(); }, answer};
}

int main() { return wire::serve("CGAL " CGAL_VERSION_STR ", Simple_cartesian<double>, GCC " __VERSION__, prepare); }
