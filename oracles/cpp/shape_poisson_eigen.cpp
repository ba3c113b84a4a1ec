// Stages shape.poisson_factor and shape.poisson_solve by Eigen's SimplicialLDLT: AMD ordering, simplicial LDL' with the up-looking algorithm.
//
// `seconds` of a factorisation is analyzePattern and factorize, of a solve SimplicialLDLT::solve of the three right sides at once.

#include <Eigen/SparseCholesky>

#include <memory>

#include "wire.hpp"

using Sparse = Eigen::SparseMatrix<double>;
using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

struct System {
    Sparse matrix;
    Columns right, solution;
    Eigen::SimplicialLDLT<Sparse, Eigen::Lower> factor;

    void solve() { solution = factor.solve(right); }

    void require_positive_definite() const {
        if (factor.info() != Eigen::Success || (factor.vectorD().array() <= 0).any()) throw std::runtime_error("the matrix is not positive definite");
    }

    wire::Message answer() const {
        wire::Reals x(std::size_t(solution.size()));
        Eigen::Map<Rows>(x.data(), solution.rows(), 3) = solution;
        return {{"x", {{std::uint64_t(solution.rows()), 3}, x}}};
    }
};

static std::shared_ptr<System> read(const wire::Message& inputs) {
    const wire::Integers &rows = wire::i64(inputs, "rows", 1), &cols = wire::i64(inputs, "cols", 1);
    const wire::Reals &values = wire::f64(inputs, "values", 1), &b = wire::f64(inputs, "b", 2);
    const auto& shape = inputs.at("b").shape;
    if (rows.size() != cols.size() || rows.size() != values.size() || shape[1] != 3)
        throw std::invalid_argument("rows, cols and values are as long as each other, and b is (n,3)");
    const std::uint64_t n = shape[0];
    if (n == 0 || n > std::numeric_limits<int>::max()) throw wire::Unsupported("Eigen counts unknowns by int, here from one");

    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t e = 0; e < rows.size(); ++e) {
        if (cols[e] < 0 || cols[e] > rows[e] || std::uint64_t(rows[e]) >= n)
            throw std::invalid_argument("an entry is not in the lower triangle");
        entries.emplace_back(int(rows[e]), int(cols[e]), values[e]);
    }
    auto system = std::make_shared<System>();
    system->matrix.resize(int(n), int(n));
    system->matrix.setFromTriplets(entries.begin(), entries.end());
    system->right = Eigen::Map<const Rows>(b.data(), Eigen::Index(n), 3);
    return system;
}

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "shape.poisson_factor" && stage != "shape.poisson_solve")
        throw wire::Unsupported("Eigen answers shape.poisson_factor and shape.poisson_solve only");
    const auto system = read(inputs);
    if (stage == "shape.poisson_factor")
        return {[=] { system->factor.compute(system->matrix); }, [=] {
                    system->require_positive_definite();
                    system->solve();
                    return system->answer();
                }};
    system->factor.compute(system->matrix);
    system->require_positive_definite();
    return {[=] { system->solve(); }, [=] { return system->answer(); }};
}

#define TEXT(x) #x
#define NUMBER(x) TEXT(x)
int main() {
    const char* version = "Eigen " NUMBER(EIGEN_WORLD_VERSION) "." NUMBER(EIGEN_MAJOR_VERSION) "." NUMBER(EIGEN_MINOR_VERSION) ", GCC " __VERSION__;
    return wire::serve(version, prepare);
}
