// Points of a cloud and their nearest neighbours: planes through them, and Delaunay stars in those planes.
//
// d points (d, 3) · k neighbours (d, k), nearest first.  The formulas are explained where their twins are:
// train/cloud/normals.py and train/cloud/stars.py.  Points are independent of each other, and shared out to threads.
#pragma once

#include <Eigen/Eigenvalues>

#include "piece.hpp"
#include "team.hpp"
#include "topology.hpp"

namespace flexpara {

struct Cloud {
    const double* points;
    const Index* neighbours;
    std::size_t count, k;

    std::array<double, 3> at(Index i) const { return {points[3 * i], points[3 * i + 1], points[3 * i + 2]}; }
    Index neighbour(std::size_t i, std::size_t j) const { return neighbours[i * k + j]; }
};

constexpr std::size_t kShare = 4096;  // points that a thread takes at a time

inline int share_count(std::size_t count) { return int((count + kShare - 1) / kShare); }

template <class Work>
void each_point(std::size_t count, int threads, Work work) {
    Team(std::min(threads, share_count(count))).each(share_count(count), [&](int piece) {
        work(piece, piece * kShare, std::min(count, (piece + 1) * kShare));
    });
}

// Unit normals (d, 3), of either sign, of planes through each point's first `wide` neighbours and itself.
// weight: (d, wide) of those neighbours.  scale: (d,) distance from the plane at which a point counts half.
inline void planes(const Cloud& cloud, std::size_t wide, const double* weight, const double* scale, int rounds,
                   int threads, double* normals) {
    each_point(cloud.count, threads, [&](int, std::size_t first, std::size_t end) {
        std::vector<std::array<double, 3>> around(wide + 1);
        std::vector<double> near(wide + 1), counts(wide + 1);
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
        for (std::size_t i = first; i < end; ++i) {
            around[0] = {0.0, 0.0, 0.0}, near[0] = 1.0;
            for (std::size_t j = 0; j < wide; ++j) {
                around[j + 1] = difference(cloud.at(cloud.neighbour(i, j)), cloud.at(Index(i)));
                near[j + 1] = weight[i * wide + j];
            }
            counts = near;
            std::array<double, 3> normal{};
            for (int round = 0; round <= rounds; ++round) {
                std::array<double, 3> middle{};
                double total = 0.0;
                for (double count : counts) total += count;
                for (std::size_t j = 0; j <= wide; ++j)
                    for (int c = 0; c < 3; ++c) middle[c] += counts[j] / total * around[j][c];
                Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
                for (std::size_t j = 0; j <= wide; ++j) {
                    const auto off = difference(around[j], middle);
                    for (int r = 0; r < 3; ++r)
                        for (int c = 0; c < 3; ++c) spread(r, c) += counts[j] / total * off[r] * off[c];
                }
                solver.compute(spread);
                for (int c = 0; c < 3; ++c) normal[c] = solver.eigenvectors()(c, 0);
                for (std::size_t j = 0; j <= wide; ++j) {
                    const double off = dot(difference(around[j], middle), normal) / scale[i];
                    counts[j] = near[j] / (1.0 + off * off);
                }
            }
            std::copy(normal.begin(), normal.end(), normals + 3 * i);
        }
    });
}

// A star's numbers: see CloudConfig.
struct StarRules {
    int most;
    double opposite, steep;
};

// The star of one point among its neighbours, rolled into its plane and inverted; the origin comes last.
class Star {
   public:
    explicit Star(std::size_t k) : image_(k + 1) {}

    // Triangles (point, neighbour, neighbour), anticlockwise as seen from the normal's tip, are appended.
    // across, along, normals: (d, 3) each.
    void collect(const Cloud& cloud, Index i, const double* across, const double* along, const double* normals,
                 const StarRules& rules, std::vector<Index>& found) {
        if (!roll(cloud, i, across + 3 * i, along + 3 * i, normals, rules)) return;
        const int k = int(image_.size()) - 1;
        int start = k;
        for (int j = k; j >= 0; --j)
            if (length(j) >= length(start)) start = j;
        int at = start;
        Point heading = {-image_[at][1], image_[at][0]};
        for (int step = 0; step < rules.most; ++step) {
            const int next = following(at, heading);
            if (at < k && next < k)
                found.insert(found.end(), {i, cloud.neighbour(i, at), cloud.neighbour(i, next)});
            if (next == start) return;
            heading = {image_[next][0] - image_[at][0], image_[next][1] - image_[at][1]};
            at = next;
        }
    }

   private:
    using Point = std::array<double, 2>;

    // −1 for a neighbour that does not belong.
    double length(int j) const {
        const double square = image_[j][0] * image_[j][0] + image_[j][1] * image_[j][1];
        return std::isfinite(square) ? square : -1.0;
    }

    // Whether two or more neighbours belong.
    bool roll(const Cloud& cloud, Index i, const double* across, const double* along, const double* normals,
              const StarRules& rules) {
        const double* normal = normals + 3 * i;
        double largest = 0.0;
        int belonging = 0;
        for (std::size_t j = 0; j < cloud.k; ++j) {
            const Index other = cloud.neighbour(i, j);
            const auto way = difference(cloud.at(other), cloud.at(i));
            const double x = way[0] * across[0] + way[1] * across[1] + way[2] * across[2];
            const double y = way[0] * along[0] + way[1] * along[1] + way[2] * along[2];
            const double distance = std::sqrt(dot(way, way)), width = std::sqrt(x * x + y * y);
            const double* theirs = normals + 3 * other;
            const double facing = theirs[0] * normal[0] + theirs[1] * normal[1] + theirs[2] * normal[2];
            image_[j] = {NAN, NAN};
            if (!(facing > rules.opposite && width > rules.steep * distance && distance > 0.0)) continue;
            // rolled: (x, y) · distance / width; inverted: that over distance²
            image_[j] = {x / width / distance, y / width / distance};
            largest = std::max({largest, std::abs(image_[j][0]), std::abs(image_[j][1])});
            ++belonging;
        }
        image_.back() = {0.0, 0.0};
        for (auto& point : image_) point[0] /= largest + 2.3e-308, point[1] /= largest + 2.3e-308;
        return belonging >= 2;
    }

    // The next corner of the hull anticlockwise, by gift wrapping.
    int following(int at, const Point& heading) const {
        int best = 0;
        double least = INFINITY;
        for (int j = 0; j < int(image_.size()); ++j) {
            const double x = image_[j][0] - image_[at][0], y = image_[j][1] - image_[at][1];
            if (j == at || std::isnan(x)) continue;
            double turn = std::atan2(heading[0] * y - x * heading[1], x * heading[0] + y * heading[1]);
            if (turn < -1e-9) turn += 6.283185307179586;
            if (turn < least) least = turn, best = j;
        }
        return best;
    }

    std::vector<Point> image_;
};

// (t, 3) triangles of all stars, those of a point one after the other.
inline std::vector<Index> stars(const Cloud& cloud, const double* across, const double* along, const double* normals,
                                const StarRules& rules, int threads) {
    std::vector<std::vector<Index>> parts(share_count(cloud.count));
    each_point(cloud.count, threads, [&](int piece, std::size_t first, std::size_t end) {
        Star star(cloud.k);
        for (std::size_t i = first; i < end; ++i) star.collect(cloud, Index(i), across, along, normals, rules, parts[piece]);
    });
    std::vector<Index> found;
    for (const auto& part : parts) found.insert(found.end(), part.begin(), part.end());
    return found;
}

}  // namespace flexpara
