// Curvature of a surface, and the sparse solves that foretell its conformal scale.   v vertices · f faces.
//
// turn: sum of the corner angles around each vertex.  The laplacian has cotangent weights, raised to a small positive
// one where two obtuse corners face an edge.  On a rim (v,) bool values are given; inside it they are solved for.
#pragma once

#include <memory>

#include "cholesky.hpp"
#include "piece.hpp"
#include "topology.hpp"

namespace flexpara {

class Conformal {
   public:
    Conformal(const Points3& points, const Index* faces, std::size_t count, double least, double steepest)
        : turn_(points.size(), 0.0), fan_(points.size(), 0), diagonal_(points.size(), 0.0), place_(points.size(), -1) {
        const EdgeTable table = edge_table(faces, count);
        weight_.assign(table.edges.size(), 0.0);
        for (std::size_t c = 0; c < 3 * count; ++c) {
            const Index a = faces[c], b = faces[next_halfedge(Index(c))];
            const Index d = faces[next_halfedge(next_halfedge(Index(c)))];
            const auto ahead = difference(points[b], points[a]), back = difference(points[d], points[a]);
            const double cosine = dot(ahead, back);
            const auto normal = cross(ahead, back);
            const double sine = std::sqrt(dot(normal, normal));
            turn_[a] += std::atan2(sine, cosine);
            ++fan_[a];
            const double cotangent = cosine / std::max(sine, 1e-12 * (std::abs(cosine) + 1e-300));
            weight_[table.face_edges[next_halfedge(Index(c))]] += 0.5 * std::clamp(cotangent, -steepest, steepest);
        }
        for (std::size_t e = 0; e < weight_.size(); ++e) {
            weight_[e] = std::max(weight_[e], least);
            links_.emplace_back(int(table.edges[e][0]), int(table.edges[e][1]));
            diagonal_[links_[e].first] += weight_[e];
            diagonal_[links_[e].second] += weight_[e];
        }
        order_ = Cholesky<1>::ordering(int(points.size()), links_);
    }

    const std::vector<double>& turn() const { return turn_; }
    const std::vector<Index>& fan() const { return fan_; }

    // Log scale u of the conformal map that keeps the lengths along the rim.
    std::vector<double> factor(const bool* rim) {
        std::vector<double> u(turn_.size(), 0.0);
        if (!settle(rim)) return u;
        std::vector<double> x(inner_.size());
        for (std::size_t i = 0; i < inner_.size(); ++i) x[i] = turn_[inner_[i]] - 6.283185307179586;
        solver_->solve(x.data());
        for (std::size_t i = 0; i < inner_.size(); ++i) u[inner_[i]] = x[i];
        return u;
    }

    // The laplacian's product with u (v,).
    std::vector<double> product(const double* u) const {
        std::vector<double> found(diagonal_.size(), 0.0);
        for (std::size_t i = 0; i < found.size(); ++i) found[i] = diagonal_[i] * u[i];
        for (std::size_t e = 0; e < links_.size(); ++e) {
            const auto [i, j] = links_[e];
            found[i] -= weight_[e] * u[j];
            found[j] -= weight_[e] * u[i];
        }
        return found;
    }

    // values (v,), those inside the rim put where the laplacian is zero.
    void harmonic(const bool* rim, double* values) {
        if (!settle(rim)) return;
        std::vector<double> x(inner_.size(), 0.0);
        for (std::size_t e = 0; e < links_.size(); ++e) {
            const auto [i, j] = links_[e];
            if (place_[i] >= 0 && place_[j] < 0) x[place_[i]] += weight_[e] * values[j];
            if (place_[j] >= 0 && place_[i] < 0) x[place_[j]] += weight_[e] * values[i];
        }
        solver_->solve(x.data());
        for (std::size_t i = 0; i < inner_.size(); ++i) values[inner_[i]] = x[i];
    }

   private:
    // Factorizes for a rim, unless it is the last one's; false where nothing is inside, or nothing holds it.
    bool settle(const bool* rim) {
        if (!rim_.empty() && std::equal(rim_.begin(), rim_.end(), rim)) return solver_ != nullptr;
        rim_.assign(rim, rim + turn_.size());
        inner_.clear();
        for (int at : order_) {
            place_[at] = rim[at] ? -1 : int(inner_.size());
            if (!rim[at]) inner_.push_back(at);
        }
        solver_.reset();
        if (inner_.empty() || inner_.size() == turn_.size()) return false;
        std::vector<std::pair<int, int>> inside;
        for (auto [i, j] : links_)
            if (place_[i] >= 0 && place_[j] >= 0) inside.emplace_back(place_[i], place_[j]);
        solver_ = std::make_unique<Cholesky<1>>(int(inner_.size()), inside, false);
        auto& values = solver_->values();
        for (std::size_t i = 0; i < inner_.size(); ++i)
            values[solver_->slot(int(i), int(i))][0] = diagonal_[inner_[i]] * (1.0 + 1e-12) + 1e-300;
        for (std::size_t e = 0; e < links_.size(); ++e) {
            const auto [i, j] = links_[e];
            if (place_[i] >= 0 && place_[j] >= 0) values[solver_->slot(place_[i], place_[j])][0] = -weight_[e];
        }
        solver_->factorize();
        return true;
    }

    std::vector<double> turn_;
    std::vector<Index> fan_;
    std::vector<double> diagonal_, weight_;
    std::vector<std::pair<int, int>> links_;
    std::vector<int> order_, inner_, place_;
    std::vector<char> rim_;
    std::unique_ptr<Cholesky<1>> solver_;
};

}  // namespace flexpara
