// Stage sequence.distance by CGAL: an AABB_tree over the triangles of B, asked for the squared distance of every vertex of A.
//
// `seconds` includes building the tree, of every frame, since each frame has other positions.
//
// Limit of CGAL 5.5.1: AABB_tree projects onto the plane of a triangle, and takes the wrong side of one without a plane
// (Construct_projected_point_3 compares the components of the sides without their absolute values). Measured: a triangle
// 1e-9 as high as it is long gives 1e-14, 1e-12 gives 2e-8, 0 gives 1e-1. Such needles are refused.

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/version.h>

#include <memory>

#include "wire.hpp"

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;

struct Frame {
    std::vector<Kernel::Point_3> points;
    Triangles triangles;
};

static bool is_needle(const Kernel::Triangle_3& triangle) {
    const auto ab = triangle[1] - triangle[0], ac = triangle[2] - triangle[0], bc = triangle[2] - triangle[1];
    const double longest = std::max({ab.squared_length(), ac.squared_length(), bc.squared_length()});
    return std::sqrt(CGAL::cross_product(ab, ac).squared_length()) <= 1e-9 * longest;
}

struct Distances {
    wire::Reals hausdorff, mean;
};

static void measure(const Frame& frame, Distances& distances) {
    Tree tree(frame.triangles.begin(), frame.triangles.end());
    double greatest = 0, sum = 0;
    for (const auto& point : frame.points) {
        const double distance = std::sqrt(tree.squared_distance(point));
        greatest = std::max(greatest, distance);
        sum += distance;
    }
    distances.hausdorff.push_back(greatest);
    distances.mean.push_back(sum / static_cast<double>(frame.points.size()));
}

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "sequence.distance") throw wire::Unsupported("CGAL answers sequence.distance only");
    const wire::Reals &a = wire::f64(inputs, "A", 3), &b = wire::f64(inputs, "B", 3);
    const wire::Integers& faces = wire::i64(inputs, "F", 2);
    const auto& shape = inputs.at("A").shape;
    if (shape != inputs.at("B").shape || shape[2] != 3 || inputs.at("F").shape[1] != 3)
        throw std::invalid_argument("A and B are (n,V,3), F is (F,3)");
    const std::uint64_t n = shape[0], vertices = shape[1];
    if (faces.empty()) throw wire::Unsupported("no triangle to measure to");
    for (std::int64_t index : faces)
        if (index < 0 || std::uint64_t(index) >= vertices) throw std::invalid_argument("F names a vertex that is not there");

    auto frames = std::make_shared<std::vector<Frame>>(n);
    for (std::uint64_t i = 0; i < n; ++i) {
        auto point = [&](const wire::Reals& z, std::uint64_t v) {
            const double* p = &z[3 * (i * vertices + v)];
            return Kernel::Point_3(p[0], p[1], p[2]);
        };
        Frame& frame = (*frames)[i];
        for (std::uint64_t v = 0; v < vertices; ++v) frame.points.push_back(point(a, v));
        for (std::size_t f = 0; f < faces.size(); f += 3)
            frame.triangles.emplace_back(point(b, faces[f]), point(b, faces[f + 1]), point(b, faces[f + 2]));
        if (std::any_of(frame.triangles.begin(), frame.triangles.end(), is_needle))
            throw wire::Unsupported("CGAL's distance to a degenerate triangle is not exact");
    }

    auto distances = std::make_shared<Distances>();
    auto work = [=] {
        *distances = {};
        for (const Frame& frame : *frames) measure(frame, *distances);
    };
    auto answer = [=] { return wire::Message{{"hausdorff", {{n}, distances->hausdorff}}, {"mean", {{n}, distances->mean}}}; };
    return {work, answer};
}

int main() { return wire::serve("CGAL " CGAL_VERSION_STR ", Simple_cartesian<double>, GCC " __VERSION__, prepare); }
