// Conjugate gradients for a large symmetric positive definite matrix A, with a small one that answers what varies
// slowly.   n fine unknowns · m coarse ones · P (n, m) weights that add up to 1 in each row · two right sides at once.
//
// The preconditioner is one symmetric V-cycle: a Gauss–Seidel sweep forward, the coarse correction P (Pᵀ A P)⁻¹ Pᵀ,
// a sweep backward.  Its twin's has no sweeps and takes several times as many steps to the same residual.
#pragma once

#include "cholesky.hpp"

namespace flexpara {

// Rows of a sparse matrix, one after the other.
struct Rows {
    std::vector<int> begin, column;
    std::vector<double> value;
    int size() const { return int(begin.size()) - 1; }
};

class TwoLevel {
   public:
    using Pair = std::array<double, 2>;
    using Pairs = std::vector<Pair>;

    // coarse: Pᵀ A P.
    TwoLevel(Rows matrix, Rows weights, const Rows& coarse, double tolerance, int most)
        : a_(std::move(matrix)), p_(std::move(weights)), small_(coarse.size(), links(coarse)), tolerance_(tolerance),
          most_(most), diagonal_(a_.size(), 1.0) {
        for (int i = 0; i < a_.size(); ++i)
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                if (a_.column[at] == i) diagonal_[i] = a_.value[at];
        small_.clear();
        for (int i = 0; i < coarse.size(); ++i) {
            for (int at = coarse.begin[i]; at < coarse.begin[i + 1]; ++at)
                if (coarse.column[at] <= i) small_.values()[small_.slot(i, coarse.column[at])][0] = coarse.value[at];
            auto& held = small_.values()[small_.slot(i, i)][0];
            held += 1e-12 * held + 1e-300;
        }
        small_.factorize();
    }

    // x from where it is until the residual is a share of `size`; each right side has steps of its own length.
    void solve(const Pairs& right, Pairs& x, double size) const {
        Pairs residual = right, image(x.size());
        multiply(x, image);
        for (std::size_t i = 0; i < x.size(); ++i)
            for (int c = 0; c < 2; ++c) residual[i][c] -= image[i][c];
        Pairs z(x.size()), direction;
        precondition(residual, z, image);
        direction = z;
        Pair product = products(residual, z);
        for (int step = 0; step < most_; ++step) {
            const Pair left = products(residual, residual);
            if (std::sqrt(left[0] + left[1]) <= tolerance_ * size) return;
            multiply(direction, image);
            const Pair along = products(direction, image);
            const Pair far = {product[0] / std::max(along[0], 1e-300), product[1] / std::max(along[1], 1e-300)};
            for (std::size_t i = 0; i < x.size(); ++i)
                for (int c = 0; c < 2; ++c) {
                    x[i][c] += far[c] * direction[i][c];
                    residual[i][c] -= far[c] * image[i][c];
                }
            precondition(residual, z, image);
            const Pair before = product;
            product = products(residual, z);
            const Pair kept = {product[0] / std::max(before[0], 1e-300), product[1] / std::max(before[1], 1e-300)};
            for (std::size_t i = 0; i < x.size(); ++i)
                for (int c = 0; c < 2; ++c) direction[i][c] = z[i][c] + kept[c] * direction[i][c];
        }
    }

   private:
    static std::vector<std::pair<int, int>> links(const Rows& of) {
        std::vector<std::pair<int, int>> found;
        for (int i = 0; i < of.size(); ++i)
            for (int at = of.begin[i]; at < of.begin[i + 1]; ++at)
                if (of.column[at] < i) found.emplace_back(i, of.column[at]);
        return found;
    }

    static Pair products(const Pairs& one, const Pairs& other) {
        Pair sum{};
        for (std::size_t i = 0; i < one.size(); ++i)
            for (int c = 0; c < 2; ++c) sum[c] += one[i][c] * other[i][c];
        return sum;
    }

    void multiply(const Pairs& x, Pairs& image) const {
        for (int i = 0; i < a_.size(); ++i) {
            Pair sum{};
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                for (int c = 0; c < 2; ++c) sum[c] += a_.value[at] * x[a_.column[at]][c];
            image[i] = sum;
        }
    }

    // z: what one V-cycle from zero makes of a residual; `left` is scratch.
    void precondition(const Pairs& residual, Pairs& z, Pairs& left) const {
        std::fill(z.begin(), z.end(), Pair{});
        for (int i = 0; i < a_.size(); ++i) relax(residual, z, i);
        multiply(z, left);
        Pairs coarse(small_.size(), Pair{});
        for (int i = 0; i < a_.size(); ++i)
            for (int at = p_.begin[i]; at < p_.begin[i + 1]; ++at)
                for (int c = 0; c < 2; ++c) coarse[p_.column[at]][c] += p_.value[at] * (residual[i][c] - left[i][c]);
        small_.template solve<2>(coarse.empty() ? nullptr : coarse[0].data());
        for (int i = 0; i < a_.size(); ++i)
            for (int at = p_.begin[i]; at < p_.begin[i + 1]; ++at)
                for (int c = 0; c < 2; ++c) z[i][c] += p_.value[at] * coarse[p_.column[at]][c];
        for (int i = a_.size() - 1; i >= 0; --i) relax(residual, z, i);
    }

    // One unknown put where its own equation holds.
    void relax(const Pairs& residual, Pairs& z, int i) const {
        Pair sum = residual[i];
        for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
            for (int c = 0; c < 2; ++c) sum[c] -= a_.value[at] * z[a_.column[at]][c];
        for (int c = 0; c < 2; ++c) z[i][c] += sum[c] / diagonal_[i];
    }

    Rows a_, p_;
    Cholesky<1> small_;
    double tolerance_;
    int most_;
    std::vector<double> diagonal_;
};

}  // namespace flexpara
