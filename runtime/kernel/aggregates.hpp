// A smaller system in the place of a large one: unknowns that pull hard at each other become one.
//
// n unknowns · k aggregates · P (n, k).  Smoothed aggregation (Vaněk, Mandel & Brezina 1996): an aggregate is an unknown
// and those that it is linked to strongly, and one damped Jacobi step makes neighbouring aggregates overlap.  Unknowns
// without a strong link, such as pinned ones, belong to none: their own equations say where they are.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

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

// one · other, whose columns are so many; the columns of each row ascend.
inline Rows product(const Rows& one, const Rows& other, int columns) {
    Rows found;
    found.begin.push_back(0);
    std::vector<double> sum(columns, 0.0);
    std::vector<int> seen(columns, -1), row;
    for (int i = 0; i < one.size(); ++i) {
        row.clear();
        for (int at = one.begin[i]; at < one.begin[i + 1]; ++at)
            for (int to = other.begin[one.column[at]]; to < other.begin[one.column[at] + 1]; ++to) {
                const int column = other.column[to];
                if (seen[column] != i) {
                    seen[column] = i;
                    sum[column] = 0.0;
                    row.push_back(column);
                }
                sum[column] += one.value[at] * other.value[to];
            }
        std::sort(row.begin(), row.end());
        for (int column : row) {
            found.column.push_back(column);
            found.value.push_back(sum[column]);
        }
        found.begin.push_back(int(found.column.size()));
    }
    return found;
}

// Pᵀ A P; columns: of P.
inline Rows restricted(const Rows& matrix, const Rows& weights, int columns) {
    return product(transposed(weights, columns), product(matrix, weights, columns), columns);
}

class Aggregates {
   public:
    explicit Aggregates(const Rows& matrix) : a_(matrix), diagonal_(matrix.size(), 0.0), of_(matrix.size(), -1) {
        for (int i = 0; i < a_.size(); ++i)
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                if (a_.column[at] == i) diagonal_[i] += a_.value[at];
        gather(true);
        join();
        gather(false);
    }

    // Of each aggregate, the unknown that it was gathered around.
    const std::vector<int>& roots() const { return roots_; }

    // P.
    Rows weights() const {
        Rows found;
        found.begin.push_back(0);
        std::vector<std::pair<int, double>> row;
        for (int i = 0; i < a_.size(); ++i) {
            row.clear();
            if (of_[i] >= 0) {
                double held = diagonal_[i];  // what the strong links alone, and pins, leave on the diagonal
                for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                    if (a_.column[at] != i && !is_strong(i, at)) held += a_.value[at];
                const double step = held > 0.0 ? kDamping / held : 0.0;
                row.emplace_back(of_[i], 1.0 - step * held);
                for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                    if (is_strong(i, at) && of_[a_.column[at]] >= 0)
                        row.emplace_back(of_[a_.column[at]], -step * a_.value[at]);
            }
            std::stable_sort(row.begin(), row.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
            for (std::size_t k = 0; k < row.size(); ++k) {
                if (k && row[k].first == row[k - 1].first) {
                    found.value.back() += row[k].second;
                    continue;
                }
                found.column.push_back(row[k].first);
                found.value.push_back(row[k].second);
            }
            found.begin.push_back(int(found.column.size()));
        }
        return found;
    }

   private:
    static constexpr double kStrong = 0.08, kDamping = 2.0 / 3.0;

    bool is_strong(int i, int at) const {
        const int j = a_.column[at];
        return j != i && -a_.value[at] >= kStrong * std::sqrt(diagonal_[i] * diagonal_[j]);
    }

    // An aggregate around each unknown whose strong neighbours are free, all of them or (not whole) those that are.
    void gather(bool whole) {
        for (int i = 0; i < a_.size(); ++i) {
            if (of_[i] >= 0) continue;
            bool linked = false, free = true;
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                if (is_strong(i, at)) linked = true, free = free && of_[a_.column[at]] < 0;
            if (!linked || (whole && !free)) continue;
            of_[i] = int(roots_.size());
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                if (is_strong(i, at) && of_[a_.column[at]] < 0) of_[a_.column[at]] = of_[i];
            roots_.push_back(i);
        }
    }

    // What is left beside aggregates goes to that of its strongest link.
    void join() {
        std::vector<int> joined(of_);
        for (int i = 0; i < a_.size(); ++i) {
            if (of_[i] >= 0) continue;
            double most = 0.0;
            for (int at = a_.begin[i]; at < a_.begin[i + 1]; ++at)
                if (is_strong(i, at) && of_[a_.column[at]] >= 0 && -a_.value[at] > most) {
                    most = -a_.value[at];
                    joined[i] = of_[a_.column[at]];
                }
        }
        of_ = std::move(joined);
    }

    const Rows& a_;
    std::vector<double> diagonal_;
    std::vector<int> of_, roots_;
};

}  // namespace flexpara
