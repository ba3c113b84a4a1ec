// Stages shape.poisson_factor and shape.poisson_solve by CHOLMOD with its defaults: it orders by AMD, tries METIS where that is not good enough,
// keeps the better, and takes the supernodal method where the operations are many for the entries (more than 40 each), else the simplicial one
// (LDL').
//
// `seconds` of a factorisation is cholmod_analyze and cholmod_factorize, of a solve cholmod_solve2 with workspace that is kept between calls.
// The supernodal method lives off the BLAS: Debian's own is the reference BLAS unless another is installed (libopenblas0-pthread). Measure with care.
// scikit-sparse is not among the oracles: it wraps this same library, so it would be no other witness; it has no wheels, and 0.5 does not build
// with the SuiteSparse 5.12 of Debian 12.

#include <cholmod.h>

#include <memory>

#include "wire.hpp"

class System {
public:
    System(const wire::Message& inputs) {
        cholmod_start(&common_);
        common_.print = 0;
        const wire::Integers &rows = wire::i64(inputs, "rows", 1), &cols = wire::i64(inputs, "cols", 1);
        const wire::Reals &values = wire::f64(inputs, "values", 1), &b = wire::f64(inputs, "b", 2);
        const auto& shape = inputs.at("b").shape;
        if (rows.size() != cols.size() || rows.size() != values.size() || shape[1] != 3)
            throw std::invalid_argument("rows, cols and values are as long as each other, and b is (n,3)");
        n_ = shape[0];
        if (n_ == 0 || n_ > std::numeric_limits<int>::max()) throw wire::Unsupported("CHOLMOD counts unknowns by int, from one");

        cholmod_triplet* triplets = cholmod_allocate_triplet(n_, n_, rows.size(), -1, CHOLMOD_REAL, &common_);  // -1: the lower triangle
        for (std::size_t e = 0; e < rows.size(); ++e) {
            if (cols[e] < 0 || cols[e] > rows[e] || std::uint64_t(rows[e]) >= n_)
                throw std::invalid_argument("an entry is not in the lower triangle");
            static_cast<int*>(triplets->i)[e] = int(rows[e]);
            static_cast<int*>(triplets->j)[e] = int(cols[e]);
            static_cast<double*>(triplets->x)[e] = values[e];
        }
        triplets->nnz = rows.size();
        matrix_ = cholmod_triplet_to_sparse(triplets, 0, &common_);
        cholmod_free_triplet(&triplets, &common_);
        right_ = cholmod_allocate_dense(n_, 3, n_, CHOLMOD_REAL, &common_);
        for (std::size_t i = 0; i < n_; ++i)
            for (std::size_t c = 0; c < 3; ++c) static_cast<double*>(right_->x)[n_ * c + i] = b[3 * i + c];
    }

    System(const System&) = delete;

    ~System() {
        cholmod_free_factor(&factor_, &common_);
        cholmod_free_sparse(&matrix_, &common_);
        for (cholmod_dense** dense : {&right_, &solution_, &space_, &more_space_}) cholmod_free_dense(dense, &common_);
        cholmod_finish(&common_);
    }

    void factor() {
        cholmod_free_factor(&factor_, &common_);
        factor_ = cholmod_analyze(matrix_, &common_);
        if (!factor_ || !cholmod_factorize(matrix_, factor_, &common_)) throw std::runtime_error("CHOLMOD ran out of memory");
    }

    void solve() {
        if (!cholmod_solve2(CHOLMOD_A, factor_, right_, nullptr, &solution_, nullptr, &space_, &more_space_, &common_))
            throw std::runtime_error("CHOLMOD cannot solve");
    }

    void require_positive_definite() const {
        bool positive = factor_->minor == n_;
        if (!factor_->is_super && !factor_->is_ll)  // D of LDL', whose signs CHOLMOD leaves alone
            for (std::size_t j = 0; j < n_; ++j) positive &= static_cast<double*>(factor_->x)[static_cast<int*>(factor_->p)[j]] > 0;
        if (!positive) throw std::runtime_error("the matrix is not positive definite");
    }

    wire::Message answer() const {
        wire::Reals x(3 * n_);
        for (std::size_t i = 0; i < n_; ++i)
            for (std::size_t c = 0; c < 3; ++c) x[3 * i + c] = static_cast<double*>(solution_->x)[n_ * c + i];
        return {{"x", {{n_, 3}, x}}};
    }

private:
    cholmod_common common_{};
    std::size_t n_ = 0;
    cholmod_sparse* matrix_ = nullptr;
    cholmod_factor* factor_ = nullptr;
    cholmod_dense *right_ = nullptr, *solution_ = nullptr, *space_ = nullptr, *more_space_ = nullptr;
};

static wire::Job prepare(const std::string& stage, const wire::Message& inputs) {
    if (stage != "shape.poisson_factor" && stage != "shape.poisson_solve")
        throw wire::Unsupported("CHOLMOD answers shape.poisson_factor and shape.poisson_solve only");
    const auto system = std::make_shared<System>(inputs);
    if (stage == "shape.poisson_factor")
        return {[=] { system->factor(); }, [=] {
                    system->require_positive_definite();
                    system->solve();
                    return system->answer();
                }};
    system->factor();
    system->require_positive_definite();
    return {[=] { system->solve(); }, [=] { return system->answer(); }};
}

static std::string version() {
    int v[3];
    cholmod_version(v);
    return "CHOLMOD " + std::to_string(v[0]) + "." + std::to_string(v[1]) + "." + std::to_string(v[2]) + ", GCC " __VERSION__;
}

int main() { return wire::serve(version(), prepare); }
