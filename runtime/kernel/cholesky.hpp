// Sparse LDLᵀ of a symmetric positive definite matrix of B × B blocks, row by row (up-looking).
//
// n block rows · p = permuted · a "row form" block is A(k, i) with k > i.  The order is approximate minimum degree
// (Amestoy, Davis & Duff 1996, Eigen's); what a row of the factor holds follows from the elimination tree
// (Davis, Direct Methods for Sparse Linear Systems, 2006, chapter 4).  The pattern is taken once, numbers any times.
#pragma once

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

namespace flexpara {

template <int B>
using Block = std::array<double, B * B>;

template <int B>
class Cholesky {
   public:
    // links: pairs of different rows that share an entry, each pair once or more, in either order.
    // ordered_here: else rows are eliminated as they stand.
    Cholesky(int n, const std::vector<std::pair<int, int>>& links, bool ordered_here = true) : n_(n), place_(n) {
        std::iota(place_.begin(), place_.end(), 0);
        if (ordered_here) {
            const auto order = ordering(n, links);
            for (int k = 0; k < n; ++k) place_[order[k]] = k;
        }
        collect(links);
        analyze();
    }

    // The rows (n,) in an order of elimination that fills little.
    static std::vector<int> ordering(int n, const std::vector<std::pair<int, int>>& links) {
        if (n == 0) return {};
        std::vector<Eigen::Triplet<double, int>> entries;
        entries.reserve(links.size() + n);
        for (int i = 0; i < n; ++i) entries.emplace_back(i, i, 1.0);
        for (auto [i, j] : links) entries.emplace_back(i, j, 1.0);  // the ordering adds the transposed ones
        Eigen::SparseMatrix<double, Eigen::ColMajor, int> pattern(n, n);
        pattern.setFromTriplets(entries.begin(), entries.end());
        Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
        Eigen::AMDOrdering<int>()(pattern, order);
        return {order.indices().data(), order.indices().data() + n};
    }

    int size() const { return n_; }

    // Where the numbers of a pair of rows (or of one row's diagonal) go.
    int slot(int i, int j) const {
        int k = place_[i], r = place_[j];
        if (k == r) return k;
        if (k < r) std::swap(k, r);
        auto begin = rows_.begin() + begin_[k], end = rows_.begin() + begin_[k + 1];
        return n_ + int(std::lower_bound(begin, end, r) - rows_.begin());
    }

    // Blocks by slot: n diagonals, then the row forms; to be filled before factorize.
    std::vector<Block<B>>& values() { return values_; }

    void clear() {
        for (auto& block : values_) block.fill(0.0);
    }

    void factorize() {
        std::vector<int> filled(start_.begin(), start_.end() - 1);
        for (auto& block : work_) block.fill(0.0);
        for (int k = 0; k < n_; ++k) {
            for (int p = begin_[k]; p < begin_[k + 1]; ++p) work_[rows_[p]] = values_[n_ + p];
            Block<B> diagonal = values_[k];
            for (int p = reach_start_[k]; p < reach_start_[k + 1]; ++p) {
                const int i = reach_[p];
                const Block<B> z = work_[i];
                work_[i].fill(0.0);
                for (int q = start_[i]; q < filled[i]; ++q) subtract_times_transposed(work_[index_[q]], z, factor_[q]);
                const Block<B> entry = times(z, inverse_[i]);
                subtract_times_transposed(diagonal, entry, z);
                index_[filled[i]] = k;
                factor_[filled[i]++] = entry;
            }
            inverse_[k] = inverted(diagonal);
        }
    }

    // x in place: n · B unknowns one after the other, each with so many columns.
    template <int Columns = 1>
    void solve(double* x) const {
        constexpr int width = B * Columns;
        std::vector<double> y(std::size_t(n_) * width);
        for (int i = 0; i < n_; ++i) std::copy_n(x + std::size_t(i) * width, width, &y[std::size_t(place_[i]) * width]);
        for (int i = 0; i < n_; ++i)
            for (int q = start_[i]; q < start_[i + 1]; ++q)
                subtract<Columns>(&y[std::size_t(index_[q]) * width], factor_[q], &y[std::size_t(i) * width]);
        for (int i = n_ - 1; i >= 0; --i) {
            double* own = &y[std::size_t(i) * width];
            double sum[width] = {};
            for (int r = 0; r < B; ++r)
                for (int c = 0; c < B; ++c)
                    for (int k = 0; k < Columns; ++k) sum[r * Columns + k] += inverse_[i][r * B + c] * own[c * Columns + k];
            for (int q = start_[i]; q < start_[i + 1]; ++q) {
                const double* other = &y[std::size_t(index_[q]) * width];
                for (int r = 0; r < B; ++r)
                    for (int c = 0; c < B; ++c)
                        for (int k = 0; k < Columns; ++k)
                            sum[c * Columns + k] -= factor_[q][r * B + c] * other[r * Columns + k];
            }
            std::copy_n(sum, width, own);
        }
        for (int i = 0; i < n_; ++i) std::copy_n(&y[std::size_t(place_[i]) * width], width, x + std::size_t(i) * width);
    }

   private:
    template <int Columns>
    static void subtract(double* target, const Block<B>& a, const double* x) {
        for (int r = 0; r < B; ++r)
            for (int c = 0; c < B; ++c)
                for (int k = 0; k < Columns; ++k) target[r * Columns + k] -= a[r * B + c] * x[c * Columns + k];
    }

    // rows_: of each permuted row k, the rows before it that it shares an entry with, ascending.
    void collect(const std::vector<std::pair<int, int>>& links) {
        std::vector<int> first(n_ + 1, 0);
        for (auto [i, j] : links) ++first[std::max(place_[i], place_[j]) + 1];
        std::partial_sum(first.begin(), first.end(), first.begin());
        std::vector<int> before(links.size()), filled(first.begin(), first.end() - 1);
        for (auto [i, j] : links) before[filled[std::max(place_[i], place_[j])]++] = std::min(place_[i], place_[j]);
        begin_.assign(n_ + 1, 0);
        rows_.reserve(links.size());
        for (int k = 0; k < n_; ++k) {
            std::sort(before.begin() + first[k], before.begin() + first[k + 1]);
            const auto end = std::unique(before.begin() + first[k], before.begin() + first[k + 1]);
            for (auto row = before.begin() + first[k]; row != end; ++row)
                if (*row != k) rows_.push_back(*row);
            begin_[k + 1] = int(rows_.size());
        }
        values_.resize(n_ + rows_.size());
    }

    // The elimination tree, what each row of the factor holds in an order fit to solve by, and each column's length.
    void analyze() {
        std::vector<int> parent(n_, -1), ancestor(n_, -1), seen(n_, -1), count(n_, 0), path;
        reach_start_.assign(n_ + 1, 0);
        std::vector<int> row;
        for (int k = 0; k < n_; ++k) {
            for (int p = begin_[k]; p < begin_[k + 1]; ++p)
                for (int i = rows_[p]; i != -1 && i < k;) {
                    const int next = ancestor[i];
                    ancestor[i] = k;
                    if (next == -1) parent[i] = k;
                    i = next;
                }
            seen[k] = k;
            row.clear();
            for (int p = begin_[k]; p < begin_[k + 1]; ++p) {
                path.clear();
                for (int i = rows_[p]; seen[i] != k; i = parent[i]) {
                    path.push_back(i);
                    seen[i] = k;
                    ++count[i];
                }
                row.insert(row.end(), path.rbegin(), path.rend());
            }
            reach_.insert(reach_.end(), row.rbegin(), row.rend());
            reach_start_[k + 1] = int(reach_.size());
        }
        start_.assign(n_ + 1, 0);
        for (int i = 0; i < n_; ++i) start_[i + 1] = start_[i] + count[i];
        index_.resize(start_[n_]);
        factor_.resize(start_[n_]);
        inverse_.resize(n_);
        work_.resize(n_);
    }

    static void subtract_times_transposed(Block<B>& target, const Block<B>& a, const Block<B>& b) {
        for (int r = 0; r < B; ++r)
            for (int c = 0; c < B; ++c)
                for (int m = 0; m < B; ++m) target[r * B + c] -= a[r * B + m] * b[c * B + m];
    }

    static Block<B> times(const Block<B>& a, const Block<B>& b) {
        Block<B> product{};
        for (int r = 0; r < B; ++r)
            for (int c = 0; c < B; ++c)
                for (int m = 0; m < B; ++m) product[r * B + c] += a[r * B + m] * b[m * B + c];
        return product;
    }

    static Block<B> inverted(const Block<B>& a) {
        static_assert(B == 1 || B == 2);
        if constexpr (B == 1) return {1.0 / a[0]};
        else {
            const double determinant = a[0] * a[3] - a[1] * a[2];
            return {a[3] / determinant, -a[1] / determinant, -a[2] / determinant, a[0] / determinant};
        }
    }

    int n_;
    std::vector<int> place_, begin_, rows_;
    std::vector<int> reach_start_, reach_, start_, index_;
    std::vector<Block<B>> values_, factor_, inverse_, work_;
};

}  // namespace flexpara
