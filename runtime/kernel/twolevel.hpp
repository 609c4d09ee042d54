// Conjugate gradients for a large symmetric positive definite matrix A, with a small one that answers what varies
// slowly.   n fine unknowns · m coarse ones · P (n, m) weights that add up to 1 in each row · two right sides at once.
//
// The preconditioner is one symmetric V-cycle: a Gauss–Seidel sweep forward, the coarse correction P (Pᵀ A P)⁻¹ Pᵀ,
// a sweep backward.  Its twin's has no sweeps and takes several times as many steps to the same residual.  Where the
// coarse unknowns are few beside the fine ones, levels of aggregates lie between the two, or steps would be the more the
// finer a mesh is: sweeps even out what varies from one unknown to the next, not what varies over dozens of them.
// Unknowns are numbered anew, neighbours near each other, and parted in blocks.  A sweep sees within its block what it
// has just changed, and of others what was there before: blocks are swept, and all else is done, by several threads.
// Sweeps divide by the diagonal and what links a row to other blocks, without which the preconditioner may be indefinite
// (Baker, Falgout, Kolev, Yang, Multigrid Smoothers for Ultraparallel Computing, 2011).
#pragma once

#include "aggregates.hpp"
#include "cholesky.hpp"
#include "team.hpp"

#include <memory>

namespace flexpara {

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

// Some rows of a matrix.
inline Rows chosen(const Rows& of, const std::vector<int>& rows) { return reordered(of, rows, {}); }

class TwoLevel {
   public:
    using Pair = std::array<double, 2>;
    using Pairs = std::vector<Pair>;

    // coarse: how many coarse unknowns there are.
    TwoLevel(const Rows& matrix, const Rows& weights, int coarse, double tolerance, int most, int threads)
        : order_(ring_order(matrix)), tolerance_(tolerance), most_(most), threads_(threads) {
        std::vector<int> place(order_.size());
        for (std::size_t i = 0; i < order_.size(); ++i) place[order_[i]] = int(i);
        Rows last = reordered(weights, order_, {});
        levels_.emplace_back(reordered(matrix, order_, place));
        while (levels_.back().size() > kFew * coarse) {
            const Aggregates groups(levels_.back().a);
            const int count = int(groups.roots().size());
            if (count < 1 || 2 * count > levels_.back().size()) break;
            last = chosen(last, groups.roots());
            levels_.emplace_back(levels_.back().narrowed(groups.weights(), count));
        }
        const Rows small = levels_.back().narrowed(std::move(last), coarse);
        small_ = std::make_unique<Cholesky<1>>(coarse, links(small));
        small_->clear();
        for (int i = 0; i < coarse; ++i) {
            for (int at = small.begin[i]; at < small.begin[i + 1]; ++at)
                if (small.column[at] <= i) small_->values()[small_->slot(i, small.column[at])][0] = small.value[at];
            auto& held = small_->values()[small_->slot(i, i)][0];
            held += 1e-12 * held + 1e-300;
        }
        small_->factorize();
    }

    // x from where it is until the residual is a share of `size`; each right side has steps of its own length.
    void solve(const Pairs& right, Pairs& found, double size) const {
        const Level& fine = levels_.front();
        Team team(fine.size() > kBlock ? threads_ : 1);
        const std::size_t count = order_.size();
        Pairs x(count), residual(count), image(count), z(count);
        std::vector<Scratch> scratch;
        for (const Level& level : levels_) scratch.emplace_back(level);
        for (std::size_t i = 0; i < count; ++i) x[i] = found[order_[i]];
        rows(team, fine.size(), [&](int i) {
            image[i] = fine.product(x, i);
            for (int c = 0; c < 2; ++c) residual[i][c] = right[order_[i]][c] - image[i][c];
        });
        cycle(team, 0, residual, z, scratch);
        Pairs direction = z;
        Pair along = products(team, residual, z);
        for (int step = 0; step < most_; ++step) {
            const Pair left = products(team, residual, residual);
            if (std::sqrt(left[0] + left[1]) <= tolerance_ * size) break;
            rows(team, fine.size(), [&](int i) { image[i] = fine.product(direction, i); });
            const Pair steep = products(team, direction, image);
            const Pair far = {along[0] / std::max(steep[0], 1e-300), along[1] / std::max(steep[1], 1e-300)};
            rows(team, fine.size(), [&](int i) {
                for (int c = 0; c < 2; ++c) {
                    x[i][c] += far[c] * direction[i][c];
                    residual[i][c] -= far[c] * image[i][c];
                }
            });
            cycle(team, 0, residual, z, scratch);
            const Pair before = along;
            along = products(team, residual, z);
            const Pair kept = {along[0] / std::max(before[0], 1e-300), along[1] / std::max(before[1], 1e-300)};
            rows(team, fine.size(), [&](int i) {
                for (int c = 0; c < 2; ++c) direction[i][c] = z[i][c] + kept[c] * direction[i][c];
            });
        }
        for (std::size_t i = 0; i < count; ++i) found[order_[i]] = x[i];
    }

   private:
    static constexpr int kBlock = 8192;  // rows that are swept, or added up, together
    static constexpr int kFew = 12;      // unknowns for each of the next level, above which another comes between

    // One level's matrix, what its sweeps divide by, and the weights of the next level's unknowns, rows and columns.
    struct Level {
        explicit Level(Rows matrix) : a(std::move(matrix)), diagonal(a.size(), 0.0) {
            for (int i = 0; i < a.size(); ++i)
                for (int at = a.begin[i]; at < a.begin[i + 1]; ++at)
                    if (a.column[at] == i) diagonal[i] += a.value[at];
                    else if (a.column[at] / kBlock != i / kBlock) diagonal[i] += std::abs(a.value[at]);
        }

        int size() const { return a.size(); }

        // The next level's matrix, whose unknowns are so many.
        Rows narrowed(Rows weights, int columns) {
            p = std::move(weights);
            back = transposed(p, columns);
            return flexpara::product(back, flexpara::product(a, p, columns), columns);
        }

        Pair product(const Pairs& x, int i) const {
            Pair sum{};
            for (int at = a.begin[i]; at < a.begin[i + 1]; ++at)
                for (int c = 0; c < 2; ++c) sum[c] += a.value[at] * x[a.column[at]][c];
            return sum;
        }

        // Unknowns of a block put where their own equations hold, one after the other, all others being zero.
        void sweep_from_zero(const Pairs& residual, Pairs& z, int block) const {
            const int first = block * kBlock, end = std::min(size(), first + kBlock);
            for (int i = first; i < end; ++i) {
                Pair sum = residual[i];
                for (int at = a.begin[i]; at < a.begin[i + 1] && a.column[at] < i; ++at)
                    if (a.column[at] >= first)
                        for (int c = 0; c < 2; ++c) sum[c] -= a.value[at] * z[a.column[at]][c];
                for (int c = 0; c < 2; ++c) z[i][c] = sum[c] / diagonal[i];
            }
        }

        // The same from where they are, the last first; `held`: where all unknowns were.
        void sweep_back(const Pairs& residual, Pairs& z, const Pairs& held, int block) const {
            const int first = block * kBlock, end = std::min(size(), first + kBlock);
            for (int i = end - 1; i >= first; --i) {
                Pair sum = residual[i];
                for (int at = a.begin[i]; at < a.begin[i + 1]; ++at) {
                    const int j = a.column[at];
                    const Pair& other = j >= first && j < end ? z[j] : held[j];
                    for (int c = 0; c < 2; ++c) sum[c] -= a.value[at] * other[c];
                }
                for (int c = 0; c < 2; ++c) z[i][c] += sum[c] / diagonal[i];
            }
        }

        Rows a;
        std::vector<double> diagonal;
        Rows p, back;
    };

    // What a cycle holds at a level: copies of its unknowns, and of the next level's, right side and answer.
    struct Scratch {
        explicit Scratch(const Level& level) : held(level.size()), right(level.back.size()), answer(level.back.size()) {}
        Pairs held, right, answer;
    };

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

    // z: what one V-cycle from zero makes of a residual of a level.
    void cycle(Team& team, std::size_t number, const Pairs& residual, Pairs& z, std::vector<Scratch>& scratch) const {
        const Level& level = levels_[number];
        auto& [held, right, answer] = scratch[number];
        team.each(blocks(level.size()), [&](int block) { level.sweep_from_zero(residual, z, block); });
        rows(team, level.size(), [&](int i) {
            const Pair image = level.product(z, i);
            for (int c = 0; c < 2; ++c) held[i][c] = residual[i][c] - image[c];
        });
        rows(team, level.back.size(), [&](int k) {
            Pair sum{};
            for (int at = level.back.begin[k]; at < level.back.begin[k + 1]; ++at)
                for (int c = 0; c < 2; ++c) sum[c] += level.back.value[at] * held[level.back.column[at]][c];
            right[k] = sum;
        });
        if (number + 1 < levels_.size()) {
            cycle(team, number + 1, right, answer, scratch);
        } else {
            answer = right;
            small_->template solve<2>(answer.empty() ? nullptr : answer[0].data());
        }
        rows(team, level.size(), [&](int i) {
            for (int at = level.p.begin[i]; at < level.p.begin[i + 1]; ++at)
                for (int c = 0; c < 2; ++c) z[i][c] += level.p.value[at] * answer[level.p.column[at]][c];
            held[i] = z[i];
        });
        team.each(blocks(level.size()), [&](int block) { level.sweep_back(residual, z, held, block); });
    }

    std::vector<int> order_;
    std::vector<Level> levels_;
    std::unique_ptr<Cholesky<1>> small_;
    double tolerance_;
    int most_, threads_;
};

}  // namespace flexpara
