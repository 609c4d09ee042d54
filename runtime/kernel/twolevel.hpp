// Conjugate gradients for a large symmetric positive definite matrix A, with a small one that answers what varies
// slowly.   n fine unknowns · m coarse ones · P (n, m) weights that add up to 1 in each row · two right sides at once.
//
// The preconditioner is one symmetric V-cycle: a Gauss–Seidel sweep forward, the coarse correction P (Pᵀ A P)⁻¹ Pᵀ,
// a sweep backward.  Its twin's has no sweeps and takes several times as many steps to the same residual.
// Unknowns are numbered anew, neighbours near each other, and parted in blocks.  A sweep sees within its block what it
// has just changed, and of others what was there before: blocks are swept, and all else is done, by several threads.
// Sweeps divide by the diagonal and what links a row to other blocks, without which the preconditioner may be indefinite
// (Baker, Falgout, Kolev, Yang, Multigrid Smoothers for Ultraparallel Computing, 2011).
#pragma once

#include "cholesky.hpp"
#include "team.hpp"

namespace flexpara {

// Rows of a sparse matrix, one after the other.
struct Rows {
    std::vector<int> begin, column;
    std::vector<double> value;
    int size() const { return int(begin.size()) - 1; }
};

// The columns of a matrix of so many as rows.
inline Rows transposed(const Rows& of, int columns) {
    Rows found{std::vector<int>(columns + 1, 0), std::vector<int>(of.column.size()), std::vector<double>(of.value.size())};
    for (int column : of.column) ++found.begin[column + 1];
    std::partial_sum(found.begin.begin(), found.begin.end(), found.begin.begin());
    std::vector<int> filled(found.begin.begin(), found.begin.end() - 1);
    for (int i = 0; i < of.size(); ++i)
        for (int at = of.begin[i]; at < of.begin[i + 1]; ++at) {
            const int to = filled[of.column[at]]++;
            found.column[to] = i;
            found.value[to] = of.value[at];
        }
    return found;
}

// The rows of a symmetric matrix in an order in which neighbours are near: ring by ring around the first one left.
inline std::vector<int> ring_order(const Rows& of) {
    std::vector<int> order;
    std::vector<char> seen(of.size(), 0);
    order.reserve(of.size());
    for (int first = 0; first < of.size(); ++first) {
        if (seen[first]) continue;
        seen[first] = 1;
        order.push_back(first);
        for (std::size_t next = order.size() - 1; next < order.size(); ++next)
            for (int at = of.begin[order[next]]; at < of.begin[order[next] + 1]; ++at) {
                const int other = of.column[at];
                if (seen[other]) continue;
                seen[other] = 1;
                order.push_back(other);
            }
    }
    return order;
}

// Rows in a new order; place: of each old column, the new one, or nothing where columns stay.
inline Rows reordered(const Rows& of, const std::vector<int>& order, const std::vector<int>& place) {
    Rows found;
    found.begin.push_back(0);
    std::vector<std::pair<int, double>> row;
    for (int old : order) {
        row.clear();
        for (int at = of.begin[old]; at < of.begin[old + 1]; ++at)
            row.emplace_back(place.empty() ? of.column[at] : place[of.column[at]], of.value[at]);
        std::sort(row.begin(), row.end());
        for (auto [column, value] : row) {
            found.column.push_back(column);
            found.value.push_back(value);
        }
        found.begin.push_back(int(found.column.size()));
    }
    return found;
}

class TwoLevel {
   public:
    using Pair = std::array<double, 2>;
    using Pairs = std::vector<Pair>;

    // coarse: Pᵀ A P.
    TwoLevel(const Rows& matrix, const Rows& weights, const Rows& coarse, double tolerance, int most, int threads)
        : order_(ring_order(matrix)), small_(coarse.size(), links(coarse)), tolerance_(tolerance), most_(most),
          threads_(threads), diagonal_(matrix.size(), 0.0) {
        std::vector<int> place(order_.size());
        for (std::size_t i = 0; i < order_.size(); ++i) place[order_[i]] = int(i);
        a_ = reordered(matrix, order_, place);
        p_ = reordered(weights, order_, {});
        back_ = transposed(p_, coarse.size());
        for (int i = 0; i < a_.size(); ++i)
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                if (a_.column[at] == i) diagonal_[i] += a_.value[at];
                else if (a_.column[at] / kBlock != i / kBlock) diagonal_[i] += std::abs(a_.value[at]);
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
    void solve(const Pairs& right, Pairs& found, double size) const {
        Team team(a_.size() > kBlock ? threads_ : 1);
        const std::size_t count = order_.size();
        Pairs x(count), residual(count), image(count), z(count), held(count);
        for (std::size_t i = 0; i < count; ++i) x[i] = found[order_[i]];
        rows(team, a_.size(), [&](int i) {
            image[i] = product(x, i);
            for (int c = 0; c < 2; ++c) residual[i][c] = right[order_[i]][c] - image[i][c];
        });
        precondition(team, residual, z, held);
        Pairs direction = z;
        Pair along = products(team, residual, z);
        for (int step = 0; step < most_; ++step) {
            const Pair left = products(team, residual, residual);
            if (std::sqrt(left[0] + left[1]) <= tolerance_ * size) break;
            rows(team, a_.size(), [&](int i) { image[i] = product(direction, i); });
            const Pair steep = products(team, direction, image);
            const Pair far = {along[0] / std::max(steep[0], 1e-300), along[1] / std::max(steep[1], 1e-300)};
            rows(team, a_.size(), [&](int i) {
                for (int c = 0; c < 2; ++c) {
                    x[i][c] += far[c] * direction[i][c];
                    residual[i][c] -= far[c] * image[i][c];
                }
            });
            precondition(team, residual, z, held);
            const Pair before = along;
            along = products(team, residual, z);
            const Pair kept = {along[0] / std::max(before[0], 1e-300), along[1] / std::max(before[1], 1e-300)};
            rows(team, a_.size(), [&](int i) {
                for (int c = 0; c < 2; ++c) direction[i][c] = z[i][c] + kept[c] * direction[i][c];
            });
        }
        for (std::size_t i = 0; i < count; ++i) found[order_[i]] = x[i];
    }

   private:
    static constexpr int kBlock = 8192;  // rows that are swept, or added up, together

    static std::vector<std::pair<int, int>> links(const Rows& of) {
        std::vector<std::pair<int, int>> found;
        for (int i = 0; i < of.size(); ++i)
            for (int at = of.begin[i]; at < of.begin[i + 1]; ++at)
                if (of.column[at] < i) found.emplace_back(i, of.column[at]);
        return found;
    }

    static int blocks(int count) { return (count + kBlock - 1) / kBlock; }

    template <class Work>
    static void rows(Team& team, int count, Work work) {
        team.each(blocks(count), [&](int block) {
            for (int i = block * kBlock, end = std::min(count, i + kBlock); i < end; ++i) work(i);
        });
    }

    static Pair products(Team& team, const Pairs& one, const Pairs& other) {
        const int count = int(one.size());
        Pairs sums(blocks(count), Pair{});
        rows(team, count, [&](int i) {
            for (int c = 0; c < 2; ++c) sums[i / kBlock][c] += one[i][c] * other[i][c];
        });
        Pair sum{};
        for (const Pair& part : sums)
            for (int c = 0; c < 2; ++c) sum[c] += part[c];
        return sum;
    }

    Pair product(const Pairs& x, int i) const {
        Pair sum{};
        for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
            for (int c = 0; c < 2; ++c) sum[c] += a_.value[at] * x[a_.column[at]][c];
        return sum;
    }

    // z: what one V-cycle from zero makes of a residual; `held` is scratch.
    void precondition(Team& team, const Pairs& residual, Pairs& z, Pairs& held) const {
        team.each(blocks(a_.size()), [&](int block) { sweep_from_zero(residual, z, block); });
        rows(team, a_.size(), [&](int i) {
            const Pair image = product(z, i);
            for (int c = 0; c < 2; ++c) held[i][c] = residual[i][c] - image[c];
        });
        Pairs coarse(small_.size(), Pair{});
        rows(team, small_.size(), [&](int k) {
            for (int at = back_.begin[k]; at < back_.begin[k + 1]; ++at)
                for (int c = 0; c < 2; ++c) coarse[k][c] += back_.value[at] * held[back_.column[at]][c];
        });
        small_.template solve<2>(coarse.empty() ? nullptr : coarse[0].data());
        rows(team, a_.size(), [&](int i) {
            for (int at = p_.begin[i]; at < p_.begin[i + 1]; ++at)
                for (int c = 0; c < 2; ++c) z[i][c] += p_.value[at] * coarse[p_.column[at]][c];
            held[i] = z[i];
        });
        team.each(blocks(a_.size()), [&](int block) { sweep_back(residual, z, held, block); });
    }

    // Unknowns of a block put where their own equations hold, one after the other, all others being zero.
    void sweep_from_zero(const Pairs& residual, Pairs& z, int block) const {
        const int first = block * kBlock, end = std::min(a_.size(), first + kBlock);
        for (int i = first; i < end; ++i) {
            Pair sum = residual[i];
            for (int at = a_.begin[i]; at < a_.begin[i + 1] && a_.column[at] < i; ++at)
                if (a_.column[at] >= first)
                    for (int c = 0; c < 2; ++c) sum[c] -= a_.value[at] * z[a_.column[at]][c];
            for (int c = 0; c < 2; ++c) z[i][c] = sum[c] / diagonal_[i];
        }
    }

    // The same from where they are, the last first; `held`: where all unknowns were.
    void sweep_back(const Pairs& residual, Pairs& z, const Pairs& held, int block) const {
        const int first = block * kBlock, end = std::min(a_.size(), first + kBlock);
        for (int i = end - 1; i >= first; --i) {
            Pair sum = residual[i];
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at) {
                const int j = a_.column[at];
                const Pair& other = j >= first && j < end ? z[j] : held[j];
                for (int c = 0; c < 2; ++c) sum[c] -= a_.value[at] * other[c];
            }
            for (int c = 0; c < 2; ++c) z[i][c] += sum[c] / diagonal_[i];
        }
    }

    std::vector<int> order_;
    Rows a_, p_, back_;
    Cholesky<1> small_;
    double tolerance_;
    int most_, threads_;
    std::vector<double> diagonal_;
};

}  // namespace flexpara
