// Stage shape.lengths_encode by OpenMesh: calc_edge_length and calc_dihedral_angle over its half-edges. Eigen takes the rotations of
// components and parts apart.
//
// `seconds` is the work on the frames: the half-edges depend on the faces alone and are built before.
//
// Signs. OpenMesh's angle is that from the normal of a half-edge's face to the normal across, positive if the cross product of the two runs along the
// half-edge: the contract's, whichever of the two half-edges is asked. On the boundary it is 0, as in the contract.
//
// Known differences and limits of OpenMesh 9.0:
// - the angle is an arccosine: near 0 and near pi it is good to about 2e-8 only, elsewhere to rounding;
// - an edge has two half-edges that run in opposite directions: triangles that need more, or that alike run along it, are unsupported, and so is a
//   vertex whose triangles add_face cannot link.

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include <array>
#include <memory>
#include <numeric>

#include "wire.hpp"

struct Traits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    using Normal = OpenMesh::Vec3d;
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;
using Eigen::Matrix3d;

static bool is_degenerate(const Mesh& mesh, Mesh::FaceHandle face) {
    double longest = 0;
    for (const auto edge : mesh.fe_range(face)) longest = std::max(longest, mesh.calc_edge_sqr_length(edge));
    return 2 * mesh.calc_sector_area(mesh.halfedge_handle(face)) <= 1e-5 * longest;
}

// Components of vertices joined by solid triangles, numbered by lowest vertex.
struct Components {
    std::vector<int> of, root;  // of a vertex; the lowest solid triangle of a component, or -1

    Components(const Mesh& mesh, const std::vector<char>& solid) {
        std::vector<int> parent(mesh.n_vertices());
        std::iota(parent.begin(), parent.end(), 0);
        auto find = [&](int v) {
            while (parent[v] != v) v = parent[v] = parent[parent[v]];
            return v;
        };
        auto lowest_corner = [&](Mesh::FaceHandle face) { return mesh.cfv_begin(face)->idx(); };
        for (const auto face : mesh.faces())
            if (solid[face.idx()])
                for (const auto vertex : face.vertices()) {
                    const int a = find(lowest_corner(face)), b = find(vertex.idx());
                    parent[std::max(a, b)] = std::min(a, b);
                }
        of.resize(parent.size());
        for (std::size_t v = 0; v < parent.size(); ++v) {
            of[v] = parent[v] == int(v) ? int(root.size()) : of[find(int(v))];
            if (parent[v] == int(v)) root.push_back(-1);
        }
        for (const auto face : mesh.faces())
            if (int& first = root[of[lowest_corner(face)]]; solid[face.idx()] && first < 0) first = face.idx();
    }
};

// The lowest triangles of further parts, ascending: of the parts that edges between solid triangles join, those without a component's root.
static std::vector<int> further_parts(const Mesh& mesh, const std::vector<char>& solid, const std::vector<int>& roots) {
    std::vector<char> seen(solid.size(), 0);
    auto pass_over = [&](int first) {
        std::vector<Mesh::FaceHandle> next{Mesh::FaceHandle(first)};
        seen[first] = 1;
        while (!next.empty()) {
            const auto face = next.back();
            next.pop_back();
            for (const auto across : mesh.ff_range(face))
                if (solid[across.idx()] && !seen[across.idx()]) {
                    seen[across.idx()] = 1;
                    next.push_back(across);
                }
        }
    };
    for (const int root : roots)
        if (root >= 0) pass_over(root);
    std::vector<int> further;
    for (std::size_t f = 0; f < solid.size(); ++f)
        if (solid[f] && !seen[f]) {
            further.push_back(int(f));
            pass_over(int(f));
        }
    return further;
}

class Encoder {
public:
    Encoder(const wire::Reals& reference, const wire::Integers& faces) {
        std::vector<Mesh::VertexHandle> vertices;
        for (std::size_t v = 0; v < reference.size() / 3; ++v) vertices.push_back(mesh_.add_vertex(Mesh::Point(&reference[3 * v])));
        for (std::size_t f = 0; f < faces.size(); f += 3) {
            corners_.push_back({int(faces[f]), int(faces[f + 1]), int(faces[f + 2])});
            if (!mesh_.add_face(vertices[faces[f]], vertices[faces[f + 1]], vertices[faces[f + 2]]).is_valid())
                throw wire::Unsupported("OpenMesh cannot hold triangle " + std::to_string(f / 3) + ": not manifold or not oriented there");
        }
        for (const auto face : mesh_.faces()) solid_.push_back(!is_degenerate(mesh_, face));
        components_ = std::make_unique<Components>(mesh_, solid_);
        further_ = further_parts(mesh_, solid_, components_->root);

        for (const auto edge : mesh_.edges()) edges_.push_back(edge);
        auto ends = [&](Mesh::EdgeHandle edge) {
            const auto half = mesh_.halfedge_handle(edge, 0);
            const int a = mesh_.from_vertex_handle(half).idx(), b = mesh_.to_vertex_handle(half).idx();
            return std::make_pair(std::min(a, b), std::max(a, b));
        };
        std::sort(edges_.begin(), edges_.end(), [&](auto a, auto b) { return ends(a) < ends(b); });
        for (const auto edge : edges_) unit_ += mesh_.calc_edge_length(edge) / double(edges_.size());
        inverse_.resize(corners_.size());
        for (const int root : components_->root)
            if (root >= 0) inverse_[root] = trihedron(root).inverse();
        for (const int root : further_) inverse_[root] = trihedron(root).inverse();
        diagonal_ = diagonal();
        if (diagonal_ == 0) throw std::invalid_argument("the reference has no extent");
    }

    std::size_t size() const { return 2 * edges_.size() + 6 * components_->root.size() + 3 * further_.size(); }

    void encode(const double* frame, double* z) {
        for (const auto vertex : mesh_.vertices()) mesh_.set_point(vertex, Mesh::Point(frame + 3 * vertex.idx()));
        for (const auto face : mesh_.faces())
            if (solid_[face.idx()] && has_collapsed(face.idx())) throw wire::Unsupported("a frame collapses a triangle to a line: it has no normal here");
        for (const auto edge : edges_) {
            *z++ = mesh_.calc_edge_length(edge) / unit_;
            *z++ = has_angle(edge) ? mesh_.calc_dihedral_angle(edge) : 0;
        }
        place(z);
    }

private:
    bool has_angle(Mesh::EdgeHandle edge) const {
        if (mesh_.is_boundary(edge)) return false;
        auto solid = [&](int side) { return solid_[mesh_.face_handle(mesh_.halfedge_handle(edge, side)).idx()]; };
        return solid(0) && solid(1);
    }

    // Of corners a, b, c as given: [e1 e2 e1 x e2].
    Matrix3d sides(int face) const {
        const auto [a, b, c] = corners_[face];
        auto point = [&](int v) { return Eigen::Map<const Eigen::Vector3d>(mesh_.point(Mesh::VertexHandle(v)).data()); };
        const Eigen::Vector3d e1 = point(b) - point(a), e2 = point(c) - point(a);
        Matrix3d columns;
        columns << e1, e2, e1.cross(e2);
        return columns;
    }

    bool has_collapsed(int face) const {
        const Matrix3d of = sides(face);
        return of.col(2).norm() <= 1e-14 * of.col(0).norm() * of.col(1).norm();
    }

    // [e1 e2 n], n of unit length: from triangle to triangle this maps plane to plane, and normal to normal.
    Matrix3d trihedron(int face) const {
        Matrix3d columns = sides(face);
        columns.col(2).normalize();
        return columns;
    }

    // Of a triangle from the reference to the frame.
    Matrix3d rotation(int face) const {
        const Eigen::JacobiSVD<Matrix3d> svd(trihedron(face) * inverse_[face], Eigen::ComputeFullU | Eigen::ComputeFullV);
        return svd.matrixU() * svd.matrixV().transpose();
    }

    static Eigen::Vector3d rotation_vector(const Matrix3d& rotation) {
        const Eigen::AngleAxisd turn(rotation);
        return turn.angle() * turn.axis();
    }

    void place(double* six) const {
        const std::size_t count = components_->root.size();
        std::vector<Mesh::Point> centre(count, Mesh::Point(0));
        std::vector<double> vertices(count, 0);
        for (const auto vertex : mesh_.vertices()) {
            centre[components_->of[vertex.idx()]] += mesh_.point(vertex);
            ++vertices[components_->of[vertex.idx()]];
        }
        for (std::size_t c = 0; c < count; ++c, six += 6) {
            Eigen::Map<Eigen::Vector3d> turn(six);
            turn.setZero();
            if (const int root = components_->root[c]; root >= 0) turn = rotation_vector(rotation(root));
            centre[c] /= vertices[c] * diagonal_;
            std::copy(centre[c].begin(), centre[c].end(), six + 3);
        }
        for (const int part : further_) {
            const int root = components_->root[components_->of[corners_[part][0]]];
            Eigen::Map<Eigen::Vector3d>{six} = rotation_vector(rotation(root).transpose() * rotation(part));
            six += 3;
        }
    }

    double diagonal() const {
        Mesh::Point least(std::numeric_limits<double>::infinity()), greatest = -least;
        for (const auto vertex : mesh_.vertices()) {
            least.minimize(mesh_.point(vertex));
            greatest.maximize(mesh_.point(vertex));
        }
        return mesh_.n_vertices() ? (greatest - least).norm() : 0;
    }

    Mesh mesh_;
    std::vector<std::array<int, 3>> corners_;  // as given: OpenMesh may begin a triangle at another of its corners
    std::vector<char> solid_;
    std::unique_ptr<Components> components_;
    std::vector<int> further_;
    std::vector<Mesh::EdgeHandle> edges_;  // in ascending order of their vertices
    std::vector<Matrix3d> inverse_;        // of the trihedra in the reference, for the lowest triangle of each part
    double unit_ = 0, diagonal_ = 0;
};

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "shape.lengths_encode") throw wire::Unsupported("OpenMesh answers shape.lengths_encode only");
    const wire::Reals &reference = wire::f64(inputs, "reference", 2), &frames = wire::f64(inputs, "frames", 3);
    const wire::Integers& faces = wire::i64(inputs, "F", 2);
    const auto& shape = inputs.at("frames").shape;
    const std::uint64_t n = shape[0], vertices = inputs.at("reference").shape[0];
    if (inputs.at("reference").shape[1] != 3 || inputs.at("F").shape[1] != 3 || shape[1] != vertices || shape[2] != 3)
        throw std::invalid_argument("reference is (V,3), F is (F,3) and frames are (n,V,3)");
    for (std::int64_t index : faces)
        if (index < 0 || std::uint64_t(index) >= vertices) throw std::invalid_argument("F names a vertex that is not there");
    for (std::size_t f = 0; f < faces.size(); f += 3)
        if (faces[f] == faces[f + 1] || faces[f + 1] == faces[f + 2] || faces[f + 2] == faces[f])
            throw wire::Unsupported("a triangle names a vertex twice: its edges are not defined");

    auto encoder = std::make_shared<Encoder>(reference, faces);
    auto z = std::make_shared<wire::Reals>(n * encoder->size());
    auto work = [=, &frames] {
        for (std::uint64_t i = 0; i < n; ++i) encoder->encode(&frames[3 * vertices * i], &(*z)[encoder->size() * i]);
    };
    return {work, [=] { return wire::Message{{"z", {{n, encoder->size()}, *z}}}; }};
}

int main() {
    return wire::serve("OpenMesh " + std::to_string(OM_GET_VER) + "." + std::to_string(OM_GET_MAJ) + ", GCC " __VERSION__, prepare);
}
