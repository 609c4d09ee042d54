// Where triangles of a layout have to be looked at to know that none overlap: along its rim.
//
// Triangles are counter-clockwise and have area.  An edge that exactly two of them share, one on either side, is inner;
// any other is rim, and so is a triangle with such an edge.  How many triangles cover a place changes only across rim
// edges, by the triangles there.  So where some place is covered twice, the border of all such places runs along a rim
// edge, and the triangle at that edge overlaps another: where no rim triangle overlaps any, none do.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

namespace flexpara {

using Point = std::array<double, 2>;
using Triangle = std::array<Point, 3>;

// Which triangles are rim.
class Rim {
   public:
    explicit Rim(const std::vector<Triangle>& triangles) : triangles_(triangles) {
        std::size_t size = 16;
        while (size < 6 * triangles.size()) size *= 2;
        first_.assign(size, -1);
        seen_.assign(size, {});
        std::vector<std::uint32_t> slot(3 * triangles.size());
        for (std::size_t h = 0; h < slot.size(); ++h) {
            slot[h] = std::uint32_t(slot_of(std::int64_t(h)));
            auto& times = seen_[slot[h]][ascends(std::int64_t(h))];
            times = std::uint8_t(std::min(2, times + 1));
        }
        marked_.assign(triangles.size(), 0);
        for (std::size_t h = 0; h < slot.size(); ++h)
            if (seen_[slot[h]][0] != 1 || seen_[slot[h]][1] != 1) marked_[h / 3] = 1;
    }

    const std::vector<char>& marked() const { return marked_; }

   private:
    const Point& start(std::int64_t h) const { return triangles_[h / 3][h % 3]; }
    const Point& end(std::int64_t h) const { return triangles_[h / 3][(h + 1) % 3]; }
    bool ascends(std::int64_t h) const { return start(h) < end(h); }

    std::size_t slot_of(std::int64_t h) {
        const Point &low = std::min(start(h), end(h)), &high = std::max(start(h), end(h));
        std::uint64_t key = 0;
        for (double value : {low[0], low[1], high[0], high[1]}) {
            value += 0.0;  // one zero
            std::uint64_t bits;
            std::memcpy(&bits, &value, sizeof bits);
            key = (key ^ bits) * 0x9e3779b97f4a7c15ull;
            key ^= key >> 32;
        }
        for (std::size_t at = key & (first_.size() - 1);; at = (at + 1) & (first_.size() - 1)) {
            if (first_[at] < 0) {
                first_[at] = h;
                return at;
            }
            const std::int64_t other = first_[at];
            if (std::min(start(other), end(other)) == low && std::max(start(other), end(other)) == high) return at;
        }
    }

    const std::vector<Triangle>& triangles_;
    std::vector<std::int64_t> first_;  // by slot: the half-edge that came first
    std::vector<std::array<std::uint8_t, 2>> seen_;
    std::vector<char> marked_;
};

// Triangles that are rim, and those whose boxes come near one that is, by a grid; all where that would take long.
inline std::vector<int> near_rim(const std::vector<Triangle>& triangles) {
    const Rim rim(triangles);
    Point low = triangles[0][0], high = low;
    for (const auto& t : triangles)
        for (const auto& p : t)
            for (int c = 0; c < 2; ++c) low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
    int side = 64;
    while (side < 2048 && std::size_t(side) * side < triangles.size()) side *= 2;
    auto cells = [&](const Triangle& t) {  // its first column and row, and its last
        std::array<int, 4> found{};
        for (int c = 0; c < 2; ++c) {
            const double width = std::max(high[c] - low[c], 1e-300);
            const auto [least, most] = std::minmax({t[0][c], t[1][c], t[2][c]});
            found[c] = std::min(side - 1, int((least - low[c]) / width * side));
            found[c + 2] = std::min(side - 1, int((most - low[c]) / width * side));
        }
        return found;
    };
    std::vector<int> sum(std::size_t(side + 1) * (side + 1), 0);
    auto at = [&](int x, int y) -> int& { return sum[std::size_t(y) * (side + 1) + x]; };
    std::size_t budget = 16 * triangles.size();
    std::vector<int> kept;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        if (!rim.marked()[i]) continue;
        const auto [x, y, far, top] = cells(triangles[i]);
        const std::size_t area = std::size_t(far - x + 1) * (top - y + 1);
        if (area > budget) {
            kept.resize(triangles.size());
            std::iota(kept.begin(), kept.end(), 0);
            return kept;
        }
        budget -= area;
        for (int row = y; row <= top; ++row)
            for (int column = x; column <= far; ++column) at(column + 1, row + 1) = 1;
    }
    for (int y = 1; y <= side; ++y)
        for (int x = 1; x <= side; ++x) at(x, y) += at(x - 1, y) + at(x, y - 1) - at(x - 1, y - 1);
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        const auto [x, y, far, top] = cells(triangles[i]);
        if (at(far + 1, top + 1) - at(x, top + 1) - at(far + 1, y) + at(x, y) > 0) kept.push_back(int(i));
    }
    return kept;
}

}  // namespace flexpara
