// Which triangles of a layout overlap, exactly: for the float64 coordinates as given, with no tolerance.
//
// Signs of determinants are taken in float64 where an error bound proves them, else in expansions (Shewchuk, Adaptive
// Precision Floating-Point Arithmetic, 1997).  Coordinates so small or large that an expansion could lose a bit are
// refused (`OutOfRange`): the twin in Python has integers of any size for those.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "rim.hpp"

namespace flexpara {

struct OutOfRange {};

inline void check_range(const double* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        const double size = std::abs(values[i]);
        if (!(size == 0.0 || (size > 1e-130 && size < 1e130))) throw OutOfRange();
    }
}

// The sign of a sum of products a · b, exactly.
inline int sign_of_products(const std::array<std::pair<double, double>, 6>& products) {
    std::array<double, 12> expansion{};
    int length = 0;
    auto grow = [&](double term) {
        int kept = 0;
        for (int i = 0; i < length; ++i) {
            const double sum = term + expansion[i], share = sum - term;
            const double lost = (term - (sum - share)) + (expansion[i] - share);
            if (lost != 0.0) expansion[kept++] = lost;
            term = sum;
        }
        if (term != 0.0) expansion[kept++] = term;
        length = kept;
    };
    for (auto [a, b] : products) {
        const double product = a * b;
        grow(std::fma(a, b, -product));
        grow(product);
    }
    const double top = length ? expansion[length - 1] : 0.0;
    return (top > 0.0) - (top < 0.0);
}

// The sign of the signed area of a b c.
inline int orientation(const Point& a, const Point& b, const Point& c) {
    const double ax = a[0] - c[0], ay = a[1] - c[1], bx = b[0] - c[0], by = b[1] - c[1];
    const double left = ax * by, right = ay * bx, value = left - right;
    constexpr double half_ulp = 1.1102230246251565e-16;
    const double bound = (3.0 + 16.0 * half_ulp) * half_ulp * (std::abs(left) + std::abs(right));
    if (std::abs(value) > bound && bound > 1e-290) return value > 0.0 ? 1 : -1;
    if ((ax == 0.0 || by == 0.0) && (ay == 0.0 || bx == 0.0)) return 0;
    return sign_of_products({{{a[0], b[1]}, {-a[1], b[0]}, {b[0], c[1]}, {-b[1], c[0]}, {c[0], a[1]}, {-c[1], a[0]}}});
}

// One of the edges of `own` has all of `other` on its right or on it; both counter-clockwise.
inline bool separates(const Triangle& own, const Triangle& other) {
    for (int i = 0; i < 3; ++i) {
        const Point &a = own[i], &b = own[(i + 1) % 3];
        if (orientation(a, b, other[0]) <= 0 && orientation(a, b, other[1]) <= 0 && orientation(a, b, other[2]) <= 0)
            return true;
    }
    return false;
}

// A tree of boxes over triangles, the two halves of each at the median of its longer side.
class Overlaps {
   public:
    // corners: (f, 3, 2).  Clockwise triangles are turned round; those without area left out.
    Overlaps(const double* corners, std::size_t count) {
        check_range(corners, 6 * count);
        for (std::size_t f = 0; f < count; ++f) {
            const double* p = corners + 6 * f;
            Triangle triangle = {Point{p[0], p[1]}, Point{p[2], p[3]}, Point{p[4], p[5]}};
            const int sign = orientation(triangle[0], triangle[1], triangle[2]);
            if (sign == 0) continue;
            if (sign < 0) std::swap(triangle[0], triangle[2]);
            triangles_.push_back(triangle);
            ids_.push_back(std::int64_t(f));
        }
        if (triangles_.size() >= kMany && !overlaps_at_rim()) return;
        plant();
    }

    // Calls found(lower, higher) for each pair that overlaps, until it returns false.
    template <class Found>
    void each(Found found) {
        if (!nodes_.empty()) within(0, found);
    }

   private:
    explicit Overlaps(std::vector<Triangle> triangles) : triangles_(std::move(triangles)), ids_(triangles_.size()) {
        std::iota(ids_.begin(), ids_.end(), 0);
        plant();
    }

    // Whether any overlap, from those near the rim alone.
    bool overlaps_at_rim() const {
        std::vector<Triangle> near;
        for (int i : near_rim(triangles_)) near.push_back(triangles_[i]);
        bool any = near.size() > triangles_.size() / 2;  // a tree of all takes no longer
        if (!any) Overlaps(std::move(near)).each([&](std::int64_t, std::int64_t) { return !(any = true); });
        return any;
    }

    void plant() {
        measure();
        order_.resize(triangles_.size());
        std::iota(order_.begin(), order_.end(), 0);
        if (!order_.empty()) build(0, int(order_.size()));
    }

    static constexpr std::size_t kMany = 2000;  // triangles from which on the rim is looked at first
    static constexpr int kAxes = 3;  // x, y, and across the direction of most edge length: needles aslant, side by side
    static constexpr int kLeaf = 4;
    struct Box {
        std::array<double, kAxes> low, high;
    };
    struct Node {
        Box box;
        int begin, end, left = -1, right = -1;
    };

    void measure() {
        double xx = 0.0, xy = 0.0, yy = 0.0, largest = 0.0, longest = 1e-300;
        for (const auto& t : triangles_)
            for (int i = 0; i < 3; ++i)
                for (int c = 0; c < 2; ++c) {
                    largest = std::max(largest, std::abs(t[i][c]));
                    longest = std::max(longest, std::abs(t[(i + 1) % 3][c] - t[i][c]));
                }
        for (const auto& t : triangles_)
            for (int i = 0; i < 3; ++i) {
                const double x = (t[(i + 1) % 3][0] - t[i][0]) / longest, y = (t[(i + 1) % 3][1] - t[i][1]) / longest;
                xx += x * x, xy += x * y, yy += y * y;
            }
        const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy), across[2] = {-std::sin(angle), std::cos(angle)};
        const double slack = 16.0 * 1.1102230246251565e-16 * largest;
        for (const auto& t : triangles_) {
            Box box;
            for (int axis = 0; axis < kAxes; ++axis) {
                double low = INFINITY, high = -INFINITY;
                for (const auto& p : t) {
                    const double at = axis < 2 ? p[axis] : p[0] * across[0] + p[1] * across[1];
                    low = std::min(low, at), high = std::max(high, at);
                }
                box.low[axis] = axis < 2 ? low : low - slack;
                box.high[axis] = axis < 2 ? high : high + slack;
            }
            boxes_.push_back(box);
        }
    }

    static bool meet(const Box& a, const Box& b) {
        for (int axis = 0; axis < kAxes; ++axis)
            if (a.low[axis] >= b.high[axis] || b.low[axis] >= a.high[axis]) return false;
        return true;
    }

    int build(int begin, int end) {
        Box box = boxes_[order_[begin]];
        for (int n = begin + 1; n < end; ++n)
            for (int axis = 0; axis < kAxes; ++axis) {
                box.low[axis] = std::min(box.low[axis], boxes_[order_[n]].low[axis]);
                box.high[axis] = std::max(box.high[axis], boxes_[order_[n]].high[axis]);
            }
        const int number = int(nodes_.size());
        nodes_.push_back({box, begin, end});
        if (end - begin > kLeaf) {
            const int axis = box.high[0] - box.low[0] > box.high[1] - box.low[1] ? 0 : 1;
            const int middle = (begin + end) / 2;
            std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end, [&](int a, int b) {
                const double first = boxes_[a].low[axis] + boxes_[a].high[axis];
                const double second = boxes_[b].low[axis] + boxes_[b].high[axis];
                return first < second || (first == second && a < b);
            });
            const int left = build(begin, middle), right = build(middle, end);
            nodes_[number].left = left;
            nodes_[number].right = right;
        }
        return number;
    }

    template <class Found>
    bool within(int number, Found& found) {
        const Node node = nodes_[number];
        if (node.left >= 0)
            return within(node.left, found) && within(node.right, found) && between(node.left, node.right, found);
        for (int a = node.begin; a < node.end; ++a)
            for (int b = a + 1; b < node.end; ++b)
                if (!test(order_[a], order_[b], found)) return false;
        return true;
    }

    template <class Found>
    bool between(int one, int other, Found& found) {
        const Node &a = nodes_[one], &b = nodes_[other];
        if (!meet(a.box, b.box)) return true;
        if (a.left < 0 && b.left < 0) {
            for (int i = a.begin; i < a.end; ++i)
                for (int j = b.begin; j < b.end; ++j)
                    if (!test(order_[i], order_[j], found)) return false;
            return true;
        }
        if (b.left < 0 || (a.left >= 0 && a.end - a.begin >= b.end - b.begin))
            return between(a.left, other, found) && between(a.right, other, found);
        return between(one, b.left, found) && between(one, b.right, found);
    }

    template <class Found>
    bool test(int a, int b, Found& found) {
        if (!meet(boxes_[a], boxes_[b]) || separates(triangles_[a], triangles_[b]) ||
            separates(triangles_[b], triangles_[a]))
            return true;
        return found(std::min(ids_[a], ids_[b]), std::max(ids_[a], ids_[b]));
    }

    std::vector<Triangle> triangles_;
    std::vector<std::int64_t> ids_;
    std::vector<Box> boxes_;
    std::vector<int> order_;
    std::vector<Node> nodes_;
};

}  // namespace flexpara
