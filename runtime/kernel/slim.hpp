// SLIM (Rabinovich, Poranne, Panozzo & Sorkine-Hornung 2017) on one piece: symmetric Dirichlet energy, free border.
//
// v vertices · f faces · J the Jacobian of a face, its axes along edge 0 and to its left · uv in the surface's units.
// Each step solves Σ area · ‖W (J − R)‖² for the nearest rotations R and weights W that give this proxy the energy's
// own gradient, and goes as far towards the solution as no face flips and the energy falls.  The numbers that decide
// are libigl's, which is its twin.
#pragma once

#include "cholesky.hpp"
#include "piece.hpp"

namespace flexpara {

class Slim {
   public:
    // scaffold: faces of the plane around the piece, at rest as they lie; each counts like `weight` of area.
    Slim(const Points3& points, const Faces& faces, std::vector<double> uv, const Faces& scaffold = {}, double weight = 0.0) :
        faces_(joined(faces, scaffold)), uv_(std::move(uv)), rest_(rest_shapes(points, faces)),
        system_(int(uv_.size() / 2), links(faces_)), step_(uv_.size()) {
        if (!scaffold.empty()) hold(scaffold, weight);
        slots_.reserve(faces_.size());
        for (const auto& face : faces_) {
            std::array<int, 6> slot{};
            for (int i = 0, at = 0; i < 3; ++i)
                for (int j = i; j < 3; ++j) slot[at++] = system_.slot(face[i], face[j]);
            slots_.push_back(slot);
        }
        for (int i = 0; i < system_.size(); ++i) diagonal_.push_back(system_.slot(i, i));
    }

    void pin(int vertex, double x, double y, double weight) { pins_.push_back({vertex, x, y, 0.5 * weight}); }

    void run(int iterations) {
        if (iterations > 0 && !measured_) {
            energy_ = energy(uv_);
            measured_ = true;
        }
        for (int n = 0; n < iterations; ++n) {
            solve();
            search();
        }
    }

    const std::vector<double>& uv() const { return uv_; }

   private:
    struct Pin {
        int vertex;
        double x, y, weight;
    };

    static constexpr double kProximal = 5e-5;   // holds the whole in place
    static constexpr double kShy = 0.8;         // share of the way to the first flip
    static constexpr int kHalvings = 12;        // tries of a step, each half as long
    static constexpr double kIsometric = 1e-8;  // a singular value this close to 1 gets the weight 1

    static Faces joined(Faces faces, const Faces& others) {
        faces.insert(faces.end(), others.begin(), others.end());
        return faces;
    }

    void hold(const Faces& scaffold, double weight) {
        Points3 plane(uv_.size() / 2);
        for (std::size_t i = 0; i < plane.size(); ++i) plane[i] = {uv_[2 * i], uv_[2 * i + 1], 0.0};
        for (const auto& face : scaffold) {
            rest_.push_back(rest_shape(plane, face));
            rest_.back().area = weight;
        }
    }

    static std::vector<std::pair<int, int>> links(const Faces& faces) {
        std::vector<std::pair<int, int>> found;
        found.reserve(3 * faces.size());
        for (const auto& face : faces)
            for (int i = 0; i < 3; ++i) found.emplace_back(face[i], face[(i + 1) % 3]);
        return found;
    }

    // The solution less uv, in step_.
    void solve() {
        system_.clear();
        auto& values = system_.values();
        std::fill(step_.begin(), step_.end(), 0.0);
        for (std::size_t f = 0; f < faces_.size(); ++f) add(f, values);
        for (std::size_t i = 0; i < diagonal_.size(); ++i) {
            auto& block = values[diagonal_[i]];
            block[0] += kProximal;
            block[3] += kProximal;
        }
        for (const auto& pin : pins_) {
            auto& block = values[diagonal_[pin.vertex]];
            block[0] += pin.weight;
            block[3] += pin.weight;
            step_[2 * pin.vertex] += pin.weight * (pin.x - uv_[2 * pin.vertex]);
            step_[2 * pin.vertex + 1] += pin.weight * (pin.y - uv_[2 * pin.vertex + 1]);
        }
        system_.factorize();
        system_.solve(step_.data());
    }

    // One face's share of the matrix and of the right side.
    void add(std::size_t f, std::vector<Block<2>>& values) {
        const auto& face = faces_[f];
        const Rest& rest = rest_[f];
        const Matrix2 j = jacobian(rest, face, uv_.data());
        const Matrix2 root = weights(j), weight = product(root, root);
        const double cosine = j[0] + j[3], sine = j[2] - j[1], size = std::hypot(cosine, sine);
        const Matrix2 turn = {cosine / size, -sine / size, sine / size, cosine / size};
        const Matrix2 gap = {turn[0] - j[0], turn[1] - j[1], turn[2] - j[2], turn[3] - j[3]};
        const Matrix2 target = product(root, product(root, gap));
        for (int i = 0, at = 0; i < 3; ++i) {
            const double gx = rest.area * rest.gradient[i][0], gy = rest.area * rest.gradient[i][1];
            step_[2 * face[i]] += gx * target[0] + gy * target[1];
            step_[2 * face[i] + 1] += gx * target[2] + gy * target[3];
            for (int k = i; k < 3; ++k) {
                const double share = gx * rest.gradient[k][0] + gy * rest.gradient[k][1];
                auto& block = values[slots_[f][at++]];
                for (int c = 0; c < 4; ++c) block[c] += share * weight[c];
            }
        }
    }

    // W = U diag(√m(σ₁), √m(σ₂)) Uᵀ with m = 1 + 1/σ + 1/σ² + 1/σ³, as α + β J Jᵀ: no axes U are needed.  W rather
    // than its square, which of a face pressed flat would lose all that holds it the other way.
    static Matrix2 weights(const Matrix2& j) {
        const double total = std::hypot(j[0] + j[3], j[2] - j[1]), difference = std::hypot(j[0] - j[3], j[2] + j[1]);
        const double large = 0.5 * (total + difference), small = 0.5 * (total - difference);
        const double a = 1.0 / large, b = 1.0 / small;
        double high = 1.0 + a * (1.0 + a * (1.0 + a)), low = 1.0 + b * (1.0 + b * (1.0 + b));
        const bool first = std::abs(large - 1.0) < kIsometric, second = std::abs(small - 1.0) < kIsometric;
        if (first) high = 1.0;
        if (second) low = 1.0;
        if (first && second) return {1.0, 0.0, 0.0, 1.0};
        const double slope = first || second
                                 ? (high - low) / ((large - small) * (large + small))
                                 : -a * b * (1.0 + (a + b) + (a * a + a * b + b * b)) / (large + small);
        const double bend = slope / (std::sqrt(high) + std::sqrt(low));
        const double rest = std::sqrt(high) - bend * large * large;
        const double off = bend * (j[0] * j[2] + j[1] * j[3]);
        return {rest + bend * (j[0] * j[0] + j[1] * j[1]), off, off, rest + bend * (j[2] * j[2] + j[3] * j[3])};
    }

    double energy(const std::vector<double>& uv) const {
        double sum = 0.0;
        for (std::size_t f = 0; f < faces_.size(); ++f) {
            const Matrix2 j = jacobian(rest_[f], faces_[f], uv.data());
            const double determinant = j[0] * j[3] - j[1] * j[2];
            const double norm = j[0] * j[0] + j[1] * j[1] + j[2] * j[2] + j[3] * j[3];
            sum += rest_[f].area * norm * (1.0 + 1.0 / (determinant * determinant));
        }
        for (const auto& pin : pins_) {
            const double x = pin.x - uv[2 * pin.vertex], y = pin.y - uv[2 * pin.vertex + 1];
            sum += pin.weight * (x * x + y * y);
        }
        return sum;
    }

    // The first positive share of the step at which a face turns over; infinite where none does.
    double first_flip() const {
        double first = INFINITY;
        for (const auto& face : faces_) {
            const double *p = &uv_[2 * face[0]], *q = &uv_[2 * face[1]], *r = &uv_[2 * face[2]];
            const double *dp = &step_[2 * face[0]], *dq = &step_[2 * face[1]], *dr = &step_[2 * face[2]];
            const double ax = q[0] - p[0], ay = q[1] - p[1], bx = r[0] - p[0], by = r[1] - p[1];
            const double cx = dq[0] - dp[0], cy = dq[1] - dp[1], ex = dr[0] - dp[0], ey = dr[1] - dp[1];
            first = std::min(first, positive_root(cx * ey - cy * ex, ax * ey - ay * ex + cx * by - cy * bx,
                                                  ax * by - ay * bx));
        }
        return first;
    }

    // The least positive t with a t² + b t + c = 0; infinite where there is none, or where two coincide.
    static double positive_root(double a, double b, double c) {
        const double inner = b * b - 4.0 * a * c;
        if (a == 0.0 || !(inner > 0.0)) return INFINITY;
        const double one = (-b + std::sqrt(inner)) / (2.0 * a), other = (-b - std::sqrt(inner)) / (2.0 * a);
        const double least = std::min(one, other), most = std::max(one, other);
        if (least > 0.0) return least;
        return most > 0.0 ? most : INFINITY;
    }

    // As far along step_ as no face flips and the energy falls; uv stays where no share of the step lowers it.
    void search() {
        double share = std::min(1.0, kShy * first_flip());
        std::vector<double> moved(uv_.size());
        for (int n = 0; n < kHalvings; ++n, share *= 0.5) {
            for (std::size_t i = 0; i < uv_.size(); ++i) moved[i] = uv_[i] + share * step_[i];
            const double found = energy(moved);
            if (found >= energy_) continue;
            uv_.swap(moved);
            energy_ = found;
            return;
        }
    }

    Faces faces_;
    std::vector<double> uv_;
    std::vector<Rest> rest_;
    Cholesky<2> system_;
    std::vector<double> step_;
    std::vector<std::array<int, 6>> slots_;
    std::vector<int> diagonal_;
    std::vector<Pin> pins_;
    double energy_ = 0.0;
    bool measured_ = false;
};

}  // namespace flexpara
