// The local and global steps of as-rigid-as-possible flattening on one piece, all but the solve.
//
// v vertices · f faces · uv (v, 2) · Jacobians (f, 2, 2) in the plane of each face, row by row.
#pragma once

#include "piece.hpp"
#include "twolevel.hpp"

namespace flexpara {

class Rigid {
   public:
    Rigid(const Points3& points, Faces faces, int threads)
        : faces_(std::move(faces)), rest_(faces_.size()), begin_(points.size() + 1, 0), corner_(3 * faces_.size()),
          threads_(threads) {
        parts(faces_.size(), [&](std::size_t f) {
            rest_[f] = rest_shape(points, faces_[f]);
            if (!(rest_[f].area > 0.0)) rest_[f] = Rest{};
        });
        for (const auto& face : faces_)
            for (int vertex : face) ++begin_[vertex + 1];
        std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
        std::vector<int> filled(begin_.begin(), begin_.end() - 1);
        for (std::size_t f = 0; f < faces_.size(); ++f)
            for (int i = 0; i < 3; ++i) corner_[filled[faces_[f][i]]++] = int(3 * f) + i;
    }

    std::ptrdiff_t faces() const { return std::ptrdiff_t(faces_.size()); }
    std::ptrdiff_t vertices() const { return std::ptrdiff_t(begin_.size()) - 1; }

    // Gᵀ W G of the gradients G and the areas W: (v, v).
    Rows stiffness() const {
        Rows found;
        found.begin.push_back(0);
        std::vector<std::pair<int, double>> row;
        for (std::size_t v = 0; v + 1 < begin_.size(); ++v) {
            row.clear();
            for (int at = begin_[v]; at < begin_[v + 1]; ++at) {
                const Rest& rest = rest_[corner_[at] / 3];
                const auto& own = rest.gradient[corner_[at] % 3];
                for (int j = 0; j < 3; ++j) {
                    const auto& other = rest.gradient[j];
                    row.emplace_back(faces_[corner_[at] / 3][j], rest.area * (own[0] * other[0] + own[1] * other[1]));
                }
            }
            std::stable_sort(row.begin(), row.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
            for (std::size_t i = 0; i < row.size(); ++i) {
                if (i && row[i].first == row[i - 1].first) {
                    found.value.back() += row[i].second;
                    continue;
                }
                found.column.push_back(row[i].first);
                found.value.push_back(row[i].second);
            }
            found.begin.push_back(int(found.column.size()));
        }
        return found;
    }

    void jacobians(const double* uv, double* found) const {
        parts(faces_.size(), [&](std::size_t f) {
            const Matrix2 j = jacobian(rest_[f], faces_[f], uv);
            std::copy(j.begin(), j.end(), found + 4 * f);
        });
    }

    // Gᵀ W turn: what the gradients of uv have to add up to around each vertex; (v, 2).
    void right(const double* turn, double* found) const {
        parts(begin_.size() - 1, [&](std::size_t v) {
            double sum[2] = {};
            for (int at = begin_[v]; at < begin_[v + 1]; ++at) {
                const int f = corner_[at] / 3;
                const Rest& rest = rest_[f];
                const auto& own = rest.gradient[corner_[at] % 3];
                for (int c = 0; c < 2; ++c)
                    sum[c] += rest.area * (turn[4 * f + 2 * c] * own[0] + turn[4 * f + 2 * c + 1] * own[1]);
            }
            std::copy_n(sum, 2, found + 2 * v);
        });
    }

   private:
    template <class Work>
    void parts(std::size_t count, Work work) const {
        constexpr std::size_t size = 16384;
        const int pieces = int((count + size - 1) / size);
        Team(std::min(threads_, pieces)).each(pieces, [&](int piece) {
            for (std::size_t i = piece * size, end = std::min(count, i + size); i < end; ++i) work(i);
        });
    }

    Faces faces_;
    std::vector<Rest> rest_;
    std::vector<int> begin_, corner_;
    int threads_;
};

}  // namespace flexpara
