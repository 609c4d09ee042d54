// Flat regions hinged together along shared edges while nothing overlaps.  Its twin says what each step is for:
// train/charts/develop.py.   f faces · e edges · a member is what some regions have become.
#pragma once

#include <map>
#include <queue>
#include <stdexcept>
#include <tuple>

#include "exact.hpp"
#include "topology.hpp"

namespace flexpara {

// `PlanarConfig`'s numbers; digits: 10 to their power.  span: as a length.  tolerance: between places that are one.
struct UnfoldLimits {
    double shared, aspect, span, whole_end, long_side, fill, digits, tolerance;
};

// Corners of the convex hull, counter-clockwise, of places that corner numbers name (Andrew's monotone chain).
template <class Place>
std::vector<Index> hull_of(std::vector<Index> corners, const Place& place) {
    std::sort(corners.begin(), corners.end(), [&](Index a, Index b) { return place(a) < place(b); });
    corners.erase(std::unique(corners.begin(), corners.end(), [&](Index a, Index b) { return place(a) == place(b); }),
                  corners.end());
    if (corners.size() < 3) return corners;
    std::vector<Index> hull(2 * corners.size());
    std::size_t size = 0;
    auto add = [&](Index corner, std::size_t least) {
        const Point c = place(corner);
        while (size >= least) {
            const Point a = place(hull[size - 2]), b = place(hull[size - 1]);
            if ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0) break;
            --size;
        }
        hull[size++] = corner;
    };
    for (Index corner : corners) add(corner, 2);
    const std::size_t lower = size + 1;
    for (std::size_t i = corners.size() - 1; i-- > 0;) add(corners[i], lower);
    hull.resize(size - 1);
    return hull;
}

class Unfolding {
   public:
    // uv: (f, 3, 2) of each region laid flat.  region: (f,) numbers from 0 on.  length: of edges.
    Unfolding(const Index* faces, std::size_t count, const Index* region, const double* uv, const double* length,
              std::size_t edges, const UnfoldLimits& limits)
        : faces_(faces), count_(count), table_(edge_table(faces, count)), length_(length), limits_(limits),
          owner_(region, region + count), place_(3 * count), trial_(3 * count) {
        if (edges != table_.edges.size()) throw std::invalid_argument("lengths of other edges");
        for (std::size_t c = 0; c < place_.size(); ++c) place_[c] = {uv[2 * c], uv[2 * c + 1]};
        members_.resize(count ? *std::max_element(region, region + count) + 1 : 0);
        for (std::size_t f = 0; f < count; ++f) members_[region[f]].ids.push_back(Index(f));
        for (auto& member : members_) begin(member);
        begin_of_.assign(vertex_span(faces, 3 * count) + 1, 0);
        for (std::size_t c = 0; c < 3 * count; ++c) ++begin_of_[faces[c] + 1];
        std::partial_sum(begin_of_.begin(), begin_of_.end(), begin_of_.begin());
        corners_of_.resize(3 * count);
        std::vector<Index> filled(begin_of_.begin(), begin_of_.end());
        for (std::size_t c = 0; c < 3 * count; ++c) corners_of_[filled[faces[c]]++] = Index(c);
    }

    void run() {
        std::vector<std::map<Index, std::vector<Index>>> around(members_.size());
        for (std::size_t e = 0; e < table_.edges.size(); ++e) {
            if (!table_.manifold[e]) continue;
            const Index a = owner_[table_.edge_faces[e][0]], b = owner_[table_.edge_faces[e][1]];
            if (a == b) continue;
            around[a][b].push_back(Index(e));
            around[b][a].push_back(Index(e));
        }
        for (std::size_t a = 0; a < around.size(); ++a)
            for (const auto& [b, edges] : around[a])
                if (Index(a) < b) hope(Index(a), b, edges);
        std::map<std::pair<Index, Index>, Hinge> ways;
        while (!queue_.empty()) {
            const auto [share, first, second, is_exact] = queue_.top();
            queue_.pop();
            if (members_[first].ids.empty() || members_[second].ids.empty()) continue;
            if (!is_exact) {
                const Hinge hinge = best_hinge(first, second, around[first][second]);
                const double found = hinge.length / shorter_border(first, second);
                if (found < limits_.shared && !rolls_on(first, second, hinge)) continue;
                queue_.emplace(-rounded(found), first, second, true);
                ways[{first, second}] = hinge;
                continue;
            }
            const auto way = ways.extract({first, second});
            if (!joined(first, second, way.mapped())) continue;
            const Index number = Index(members_.size()) - 1;
            around.emplace_back(combined(around, first, second, number));
            for (const auto& [other, edges] : around[number]) hope(other, number, edges);
        }
    }

    // Numbers (f,) of what the regions became, from 0 on in the order of their lowest faces.
    std::vector<Index> label() const {
        std::vector<Index> found(count_), number(members_.size(), -1);
        Index next = 0;
        for (std::size_t f = 0; f < count_; ++f) {
            Index& own = number[owner_[f]];
            if (own < 0) own = next++;
            found[f] = own;
        }
        return found;
    }

    // Of each of those, in that order: the length of its border.
    std::vector<double> perimeter() const {
        std::vector<double> found;
        std::vector<char> seen(members_.size(), 0);
        for (std::size_t f = 0; f < count_; ++f)
            if (!std::exchange(seen[owner_[f]], 1)) found.push_back(members_[owner_[f]].perimeter);
        return found;
    }

    const std::vector<Point>& uv() const { return place_; }

   private:
    struct Member {
        std::vector<Index> ids, hull;  // faces, ascending; corners
        double perimeter = 0.0, area = 0.0, longer = 0.0, shorter = 0.0;
        double aspect() const { return longer / std::max(shorter, 1e-300); }
        double filled() const { return area / std::max(longer * shorter, 1e-300); }
    };
    struct Hinge {
        double cosine = 1.0, sine = 0.0, length = -1.0;
        Point shift{};
        std::vector<Index> edges;
        Point operator()(const Point& p) const {
            return {cosine * p[0] - sine * p[1] + shift[0], sine * p[0] + cosine * p[1] + shift[1]};
        }
    };
    using Entry = std::tuple<double, Index, Index, bool>;

    double rounded(double value) const { return std::nearbyint(value * limits_.digits) / limits_.digits; }

    void begin(Member& member) {
        std::map<Index, int> times;
        std::vector<Index> corners;
        for (Index face : member.ids)
            for (Index c = 3 * face; c < 3 * face + 3; ++c) {
                ++times[table_.face_edges[c]];
                corners.push_back(c);
            }
        for (const auto& [edge, count] : times)
            if (count == 1) member.perimeter += length_[edge];
        for (Index face : member.ids) member.area += std::abs(area_of(place_.data() + 3 * face));
        auto place = [&](Index c) { return place_[c]; };
        member.hull = hull_of(std::move(corners), place);
        measure(member, place);
    }

    static double area_of(const Point* p) {
        return 0.5 * ((p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]));
    }

    // The sides of the rectangle of least area around a member; it lies along a side of the hull.
    template <class Place>
    static void measure(Member& member, const Place& place) {
        double least = INFINITY;
        for (std::size_t i = 0; i < member.hull.size(); ++i) {
            const Point a = place(member.hull[i]), b = place(member.hull[(i + 1) % member.hull.size()]);
            const double size = std::hypot(b[0] - a[0], b[1] - a[1]);
            const Point along{(b[0] - a[0]) / size, (b[1] - a[1]) / size};
            Point low{INFINITY, INFINITY}, high{-INFINITY, -INFINITY};
            for (Index corner : member.hull) {
                const Point p = place(corner);
                const Point q{along[0] * p[0] + along[1] * p[1], along[0] * p[1] - along[1] * p[0]};
                for (int axis : {0, 1}) {
                    low[axis] = std::min(low[axis], q[axis]);
                    high[axis] = std::max(high[axis], q[axis]);
                }
            }
            const double wide = high[0] - low[0], tall = high[1] - low[1];
            if (!(wide * tall < least)) continue;
            least = wide * tall;
            member.longer = std::max(wide, tall);
            member.shorter = std::min(wide, tall);
        }
    }

    double shorter_border(Index first, Index second) const {
        return std::max(std::min(members_[first].perimeter, members_[second].perimeter), 1e-300);
    }

    double wider_end(Index first, Index second) const {
        return limits_.whole_end * std::max(members_[first].shorter, members_[second].shorter);
    }

    bool rolls_on(Index first, Index second, const Hinge& hinge) const {
        return hinge.length >= wider_end(first, second);
    }

    void hope(Index first, Index second, const std::vector<Index>& edges) {
        double most = 0.0;
        for (Index edge : edges) most += length_[edge];
        most *= 1.0 + 1e-9;
        const double share = most / shorter_border(first, second);
        if (share >= limits_.shared || most >= wider_end(first, second))
            queue_.emplace(-rounded(share), first, second, false);
    }

    Index face_in(Index member, Index edge) const {
        const auto [one, other] = table_.edge_faces[edge];
        return owner_[one] == member ? one : other;
    }

    Index corner_at(Index face, Index vertex) const {
        Index corner = 3 * face;
        while (faces_[corner] != vertex) ++corner;
        return corner;
    }

    std::array<Point, 2> ends(Index member, Index edge) const {
        const Index face = face_in(member, edge);
        return {place_[corner_at(face, table_.edges[edge][0])], place_[corner_at(face, table_.edges[edge][1])]};
    }

    Hinge best_hinge(Index first, Index second, const std::vector<Index>& edges) const {
        std::vector<std::array<Point, 2>> fixed, moving;
        double longest = 1e-300, most = -INFINITY;
        for (Index edge : edges) {
            fixed.push_back(ends(first, edge));
            moving.push_back(ends(second, edge));
            longest = std::max(longest, length_[edge]);
        }
        std::vector<std::size_t> order(edges.size());
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            return rounded(length_[edges[a]] / longest) > rounded(length_[edges[b]] / longest);
        });
        std::vector<char> left(edges.size(), 1);
        Hinge best;
        for (std::size_t at : order) {
            if (!left[at]) continue;
            Hinge hinge = motion(moving[at], fixed[at]);
            hinge.length = 0.0;
            for (std::size_t i = 0; i < edges.size(); ++i) {
                if (!meet(hinge, moving[i], fixed[i])) continue;
                left[i] = 0;
                hinge.edges.push_back(edges[i]);
                hinge.length += length_[edges[i]];
            }
            left[at] = 0;
            const double share = rounded(hinge.length / shorter_border(first, second));
            if (share > most) most = share, best = std::move(hinge);
        }
        return best;
    }

    static Hinge motion(const std::array<Point, 2>& moving, const std::array<Point, 2>& fixed) {
        const Point a{moving[1][0] - moving[0][0], moving[1][1] - moving[0][1]};
        const Point b{fixed[1][0] - fixed[0][0], fixed[1][1] - fixed[0][1]};
        const double cosine = a[0] * b[0] + a[1] * b[1], sine = a[0] * b[1] - a[1] * b[0];
        const double size = std::max(std::hypot(cosine, sine), 1e-300);
        Hinge hinge;
        hinge.cosine = cosine / size;
        hinge.sine = sine / size;
        const Point middle = hinge({(moving[0][0] + moving[1][0]) / 2.0, (moving[0][1] + moving[1][1]) / 2.0});
        for (int axis : {0, 1}) hinge.shift[axis] = (fixed[0][axis] + fixed[1][axis]) / 2.0 - middle[axis];
        return hinge;
    }

    bool meet(const Hinge& hinge, const std::array<Point, 2>& moving, const std::array<Point, 2>& fixed) const {
        for (int end : {0, 1}) {
            const Point p = hinge(moving[end]);
            if (!(std::hypot(p[0] - fixed[end][0], p[1] - fixed[end][1]) <= limits_.tolerance)) return false;
        }
        return true;
    }

    // Both become one member, the last; false, and nothing is changed, where it would overlap itself or sprawl.
    bool joined(Index first, Index second, const Hinge& hinge) {
        weld(first, second, hinge);
        for (Index face : members_[second].ids)
            if (orientation(trial_[3 * face], trial_[3 * face + 1], trial_[3 * face + 2]) <= 0) return false;
        const Member &a = members_[first], &b = members_[second];
        Member whole;
        auto place = [&](Index corner) { return owner_[corner / 3] == second ? trial_[corner] : place_[corner]; };
        std::vector<Index> corners(a.hull);
        corners.insert(corners.end(), b.hull.begin(), b.hull.end());
        whole.hull = hull_of(std::move(corners), place);
        whole.perimeter = a.perimeter + b.perimeter - 2.0 * hinge.length;
        whole.area = a.area + b.area;
        measure(whole, place);
        if (!is_compact(a, b, whole, hinge) || overlap(a.ids, b.ids)) return false;
        std::merge(a.ids.begin(), a.ids.end(), b.ids.begin(), b.ids.end(), std::back_inserter(whole.ids));
        for (Index face : b.ids) std::copy_n(trial_.begin() + 3 * face, 3, place_.begin() + 3 * face);
        for (Index face : whole.ids) owner_[face] = Index(members_.size());
        members_[first] = members_[second] = {};
        members_.push_back(std::move(whole));
        return true;
    }

    // The moved places of the second member, the ends of joined edges exactly where the first one has them.
    void weld(Index first, Index second, const Hinge& hinge) {
        for (Index face : members_[second].ids)
            for (Index c = 3 * face; c < 3 * face + 3; ++c) trial_[c] = hinge(place_[c]);
        for (Index edge : hinge.edges)
            for (Index vertex : table_.edges[edge]) {
                const Point place = place_[corner_at(face_in(first, edge), vertex)];
                const Point before = hinge(place_[corner_at(face_in(second, edge), vertex)]);
                for (Index i = begin_of_[vertex]; i < begin_of_[vertex + 1]; ++i) {
                    const Index corner = corners_of_[i];
                    if (owner_[corner / 3] != second) continue;
                    const Point moved = hinge(place_[corner]);
                    if (std::max(std::abs(moved[0] - before[0]), std::abs(moved[1] - before[1])) <= limits_.tolerance)
                        trial_[corner] = place;
                }
            }
    }

    bool is_compact(const Member& a, const Member& b, const Member& whole, const Hinge& hinge) const {
        const double longest = std::max({limits_.aspect, a.aspect(), b.aspect()}) * (1.0 + 1e-9);
        const bool along = hinge.length >= limits_.long_side * std::min(a.perimeter, b.perimeter);
        const double least = std::min({limits_.fill, a.filled() * 0.999, b.filled() * 0.999});
        return whole.filled() >= least && (along || whole.longer <= limits_.span || whole.aspect() <= longest);
    }

    bool overlap(const std::vector<Index>& fixed, const std::vector<Index>& moved) const {
        const Box a = box_of(fixed, place_), b = box_of(moved, trial_);
        Box both;
        for (int axis : {0, 1}) {
            both.low[axis] = std::max(a.low[axis], b.low[axis]);
            both.high[axis] = std::min(a.high[axis], b.high[axis]);
        }
        std::vector<double> near;
        const auto add = [&](const std::vector<Index>& ids, const std::vector<Point>& place) {
            const std::size_t before = near.size();
            for (Index face : ids) {
                const Box own = box_of({face}, place);
                if (!(own.high[0] > both.low[0] && own.high[1] > both.low[1] && own.low[0] < both.high[0] &&
                      own.low[1] < both.high[1]))
                    continue;
                for (Index c = 3 * face; c < 3 * face + 3; ++c) near.insert(near.end(), place[c].begin(), place[c].end());
            }
            return near.size() > before;
        };
        if (!add(fixed, place_) || !add(moved, trial_)) return false;
        bool any = false;
        Overlaps(near.data(), near.size() / 6).each([&](Index, Index) { return !(any = true); });
        return any;
    }

    struct Box {
        Point low{INFINITY, INFINITY}, high{-INFINITY, -INFINITY};
    };

    static Box box_of(const std::vector<Index>& ids, const std::vector<Point>& place) {
        Box box;
        for (Index face : ids)
            for (Index c = 3 * face; c < 3 * face + 3; ++c)
                for (int axis : {0, 1}) {
                    box.low[axis] = std::min(box.low[axis], place[c][axis]);
                    box.high[axis] = std::max(box.high[axis], place[c][axis]);
                }
        return box;
    }

    static std::map<Index, std::vector<Index>> combined(std::vector<std::map<Index, std::vector<Index>>>& around,
                                                        Index first, Index second, Index number) {
        std::map<Index, std::vector<Index>> beside;
        for (Index old : {first, second})
            for (auto& [other, edges] : std::exchange(around[old], {})) {
                if (other == first || other == second) continue;
                around[other].erase(old);
                auto& own = beside[other];
                own.insert(own.end(), edges.begin(), edges.end());
                std::sort(own.begin(), own.end());
            }
        for (const auto& [other, edges] : beside) around[other][number] = edges;
        return beside;
    }

    const Index* faces_;
    std::size_t count_;
    EdgeTable table_;
    const double* length_;
    UnfoldLimits limits_;
    std::vector<Index> owner_, begin_of_, corners_of_;
    std::vector<Point> place_, trial_;
    std::vector<Member> members_;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue_;
};

}  // namespace flexpara
