// Vertices of a flattening moved one by one to where the triangles around them are least distorted.
//
// The energy is Σ area · symmetric Dirichlet.  Moving one corner p, a triangle's Jacobian is J0 + p gᵀ: ‖J‖² is quadratic
// in p and its determinant linear, so each step is Newton's on two unknowns, shortened until all triangles stay upright
// and the energy falls.  Around a triangle that is turned over, determinants are raised first.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "piece.hpp"

namespace flexpara {

class Polish {
   public:
    Polish(const Points3& points, Faces faces, std::vector<double> uv)
        : faces_(std::move(faces)), rest_(rest_shapes(points, faces_)), uv_(std::move(uv)), first_(points.size() + 1, 0) {
        for (const auto& face : faces_)
            for (int vertex : face) ++first_[vertex + 1];
        for (std::size_t v = 0; v + 1 < first_.size(); ++v) first_[v + 1] += first_[v];
        corner_.resize(first_.back());
        std::vector<int> filled(first_.begin(), first_.end() - 1);
        for (std::size_t f = 0; f < faces_.size(); ++f)
            for (int c = 0; c < 3; ++c) corner_[filled[faces_[f][c]]++] = {int(f), c};
    }

    // Each vertex once a sweep, of triangles whose energy is above so much as it begins, or that are turned over.
    void run(int sweeps, double above) {
        for (int sweep = 0; sweep < sweeps; ++sweep) {
            const std::vector<char> chosen = above_all(above);
            for (std::size_t v = 0; v + 1 < first_.size(); ++v)
                if (chosen[v] && gather(v)) move(v);
        }
    }

    const std::vector<double>& uv() const { return uv_; }

   private:
    static constexpr double kUpright = 0.01;  // determinant below which a triangle counts as turned over …
    static constexpr double kRaised = 0.3;    // … and up to which it is raised
    static constexpr int kShorter = 8;        // times that a step is halved
    struct Corner {
        int face, corner;
    };
    // ‖J‖² = square · |p|² + 2 slope · p + rest, det J = base + way · p.
    struct Term {
        double area, square, rest, base;
        std::array<double, 2> slope, way;
        double norm(double x, double y) const { return square * (x * x + y * y) + 2.0 * (slope[0] * x + slope[1] * y) + rest; }
        double determinant(double x, double y) const { return base + way[0] * x + way[1] * y; }
    };

    std::vector<char> above_all(double above) const {
        std::vector<char> chosen(first_.size() - 1, above <= 0.0);
        for (std::size_t f = 0; f < faces_.size() && above > 0.0; ++f) {
            const Matrix2 j = jacobian(rest_[f], faces_[f], uv_.data());
            const double norm = j[0] * j[0] + j[1] * j[1] + j[2] * j[2] + j[3] * j[3];
            const double determinant = j[0] * j[3] - j[1] * j[2];
            if (determinant < kUpright || norm * (1.0 + 1.0 / (determinant * determinant)) / 4.0 - 1.0 > above)
                for (int vertex : faces_[f]) chosen[vertex] = 1;
        }
        return chosen;
    }

    bool gather(std::size_t v) {
        terms_.clear();
        turned_ = false;
        const double x = uv_[2 * v], y = uv_[2 * v + 1];
        for (int n = first_[v]; n < first_[v + 1]; ++n) {
            const auto [f, c] = corner_[n];
            const Rest& rest = rest_[f];
            if (!(rest.area > 0.0) || !std::isfinite(rest.gradient[0][1])) continue;
            const auto& g = rest.gradient[c];
            Matrix2 j = jacobian(rest, faces_[f], uv_.data());
            j[0] -= x * g[0], j[1] -= x * g[1], j[2] -= y * g[0], j[3] -= y * g[1];
            Term term;
            term.area = rest.area;
            term.square = g[0] * g[0] + g[1] * g[1];
            term.slope = {j[0] * g[0] + j[1] * g[1], j[2] * g[0] + j[3] * g[1]};
            term.rest = j[0] * j[0] + j[1] * j[1] + j[2] * j[2] + j[3] * j[3];
            term.base = j[0] * j[3] - j[1] * j[2];
            term.way = {g[0] * j[3] - g[1] * j[2], j[0] * g[1] - j[1] * g[0]};
            const double determinant = term.determinant(x, y);
            turned_ = turned_ || determinant < kUpright;
            terms_.push_back(term);
        }
        return !terms_.empty();
    }

    double energy(double x, double y) const {
        double sum = 0.0;
        for (const auto& term : terms_) {
            const double determinant = term.determinant(x, y);
            if (turned_) {
                const double lack = std::max(kRaised - determinant, 0.0);
                sum += term.area * (lack * lack + 1e-3 * term.norm(x, y));
            } else {
                if (determinant < kUpright) return INFINITY;
                sum += term.area * term.norm(x, y) * (1.0 + 1.0 / (determinant * determinant)) / 4.0;
            }
        }
        return sum;
    }

    void move(std::size_t v) {
        const double x = uv_[2 * v], y = uv_[2 * v + 1];
        double gx = 0.0, gy = 0.0, xx = 0.0, xy = 0.0, yy = 0.0, plain = 0.0;
        for (const auto& term : terms_) {
            const double determinant = term.determinant(x, y), a = term.area;
            const double qx = 2.0 * (term.square * x + term.slope[0]), qy = 2.0 * (term.square * y + term.slope[1]);
            double along, turn, first, mixed;  // weights of ∇Q, of w, of ∇²Q, and of ∇Q wᵀ + w ∇Qᵀ
            double second;                     // and of w wᵀ
            if (turned_) {
                const double lack = std::max(kRaised - determinant, 0.0);
                along = 1e-3 * a, turn = -2.0 * a * lack, first = along, mixed = 0.0;
                second = lack > 0.0 ? 2.0 * a : 0.0;
            } else {
                const double inverse = 1.0 / determinant, squared = inverse * inverse, norm = term.norm(x, y);
                along = 0.25 * a * (1.0 + squared), turn = -0.5 * a * norm * squared * inverse, first = along;
                mixed = -0.5 * a * squared * inverse, second = 1.5 * a * norm * squared * squared;
            }
            gx += along * qx + turn * term.way[0];
            gy += along * qy + turn * term.way[1];
            xx += 2.0 * first * term.square + 2.0 * mixed * qx * term.way[0] + second * term.way[0] * term.way[0];
            yy += 2.0 * first * term.square + 2.0 * mixed * qy * term.way[1] + second * term.way[1] * term.way[1];
            xy += mixed * (qx * term.way[1] + qy * term.way[0]) + second * term.way[0] * term.way[1];
            plain += 2.0 * first * term.square;
        }
        // both eigenvalues at least a share of what ‖J‖² alone gives
        const double middle = 0.5 * (xx + yy), spread = std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
        const double raise = std::max(0.1 * plain - (middle - spread), 0.0);
        xx += raise, yy += raise;
        const double determinant = xx * yy - xy * xy;
        if (!(determinant > 0.0)) return;
        const double dx = -(yy * gx - xy * gy) / determinant, dy = -(xx * gy - xy * gx) / determinant;
        const double before = energy(x, y);
        double step = 1.0;
        for (int n = 0; n < kShorter; ++n, step *= 0.5) {
            const double there = energy(x + step * dx, y + step * dy);
            if (there < before) {
                uv_[2 * v] = x + step * dx, uv_[2 * v + 1] = y + step * dy;
                return;
            }
        }
    }

    Faces faces_;
    std::vector<Rest> rest_;
    std::vector<double> uv_;
    std::vector<int> first_;
    std::vector<Corner> corner_;
    std::vector<Term> terms_;
    bool turned_ = false;
};

}  // namespace flexpara
