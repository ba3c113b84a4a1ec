// Stage mesh.quality by CGAL: boxes of triangles that overlap (box_self_intersection_d), then exact predicates.
//
// Of two triangles without a common vertex do_intersect decides. Of two with one common vertex, an edge opposite to it meets the other triangle
// where they meet in more than the vertex. Area and volume are sums of the kernel's own: squared_area and volume, of doubles.

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/box_intersection_d.h>
#include <CGAL/version.h>

#include <memory>

#include "wire.hpp"

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Box = CGAL::Box_intersection_d::Box_with_info_d<double, 3, std::size_t>;
using Corners = std::array<std::int64_t, 3>;

struct Answer {
    wire::Reals area, volume;
    wire::Integers intersections, faces;
};

// The corners of f and g that are one vertex; `a` and `b` are where the last of them stands in each.
static int common(const Corners& f, const Corners& g, int& a, int& b) {
    int count = 0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (f[i] == g[j]) ++count, a = i, b = j;
    return count;
}

static void measure(const std::vector<Point>& points, const std::vector<Corners>& faces, Answer& answer) {
    std::vector<Kernel::Triangle_3> triangles;
    std::vector<Box> boxes;
    double area = 0, volume = 0;
    for (const Corners& f : faces) {
        triangles.emplace_back(points[f[0]], points[f[1]], points[f[2]]);
        boxes.emplace_back(triangles.back().bbox(), boxes.size());
        area += std::sqrt(triangles.back().squared_area());
        volume += CGAL::volume(Point(CGAL::ORIGIN), points[f[0]], points[f[1]], points[f[2]]);
    }

    std::int64_t pairs = 0;
    std::vector<char> meets(faces.size(), 0);
    CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), [&](const Box& first, const Box& second) {
        const std::size_t f = first.info(), g = second.info();
        int a = 0, b = 0;
        const int shared = common(faces[f], faces[g], a, b);
        bool meeting = false;
        if (shared == 0) {
            meeting = CGAL::do_intersect(triangles[f], triangles[g]);
            pairs += meeting;
        } else if (shared == 1) {
            const Kernel::Segment_3 across_f(triangles[f][a + 1], triangles[f][a + 2]), across_g(triangles[g][b + 1], triangles[g][b + 2]);
            meeting = CGAL::do_intersect(across_f, triangles[g]) || CGAL::do_intersect(across_g, triangles[f]);
        }
        if (meeting) meets[f] = meets[g] = 1;
    });

    answer.area.push_back(area);
    answer.volume.push_back(volume);
    answer.intersections.push_back(pairs);
    answer.faces.push_back(std::count(meets.begin(), meets.end(), 1));
}

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "mesh.quality") throw wire::Unsupported("this oracle answers mesh.quality only");
    const wire::Reals& x = wire::f64(inputs, "frames", 3);
    const wire::Integers& corners = wire::i64(inputs, "F", 2);
    const auto& shape = inputs.at("frames").shape;
    if (shape[2] != 3 || inputs.at("F").shape[1] != 3) throw std::invalid_argument("frames is (n,V,3), F is (F,3)");
    const std::uint64_t n = shape[0], vertices = shape[1];
    for (std::int64_t index : corners)
        if (index < 0 || std::uint64_t(index) >= vertices) throw std::invalid_argument("F names a vertex that is not there");

    auto faces = std::make_shared<std::vector<Corners>>();
    for (std::size_t f = 0; f < corners.size(); f += 3) faces->push_back({corners[f], corners[f + 1], corners[f + 2]});
    auto frames = std::make_shared<std::vector<std::vector<Point>>>(n);
    for (std::uint64_t i = 0; i < n; ++i) {
        auto& points = (*frames)[i];
        for (std::uint64_t v = 0; v < vertices; ++v) {
            const double* p = &x[3 * (i * vertices + v)];
            points.emplace_back(p[0], p[1], p[2]);
        }
        for (const Corners& f : *faces)
            if (CGAL::collinear(points[f[0]], points[f[1]], points[f[2]]))
                throw wire::Unsupported("a triangle of no area in frame " + std::to_string(i));
    }

    auto found = std::make_shared<Answer>();
    auto work = [=] {
        *found = {};
        for (const auto& points : *frames) measure(points, *faces, *found);
    };
    auto answer = [=] {
        return wire::Message{{"area", {{n}, found->area}},
                             {"volume", {{n}, found->volume}},
                             {"intersections", {{n}, found->intersections}},
                             {"intersecting_faces", {{n}, found->faces}}};
    };
    return {work, answer};
}

int main() { return wire::serve("CGAL " CGAL_VERSION_STR ", exact predicates, GCC " __VERSION__, prepare); }
