// Edges, fans, loops and components of triangle index arrays.   f faces · e edges · half-edge 3·face + i runs from
// corner i to corner (i + 1) % 3.  What each table holds is said where its twin is: runtime/geometry/topology.py.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

namespace flexpara {

using Index = std::int64_t;

inline Index next_halfedge(Index half) { return half % 3 == 2 ? half - 2 : half + 1; }

struct EdgeTable {
    std::vector<std::array<Index, 2>> edges, edge_faces, edge_halfedges;
    std::vector<Index> face_edges, edge_count;
    std::vector<char> manifold;
};

inline Index vertex_span(const Index* faces, std::size_t corners) {
    return corners ? *std::max_element(faces, faces + corners) + 1 : 0;
}

// Half-edges in order of their lower vertex, then their higher one, then themselves.
inline EdgeTable edge_table(const Index* faces, std::size_t count) {
    const std::size_t halves = 3 * count;
    auto end_of = [&](Index half) { return faces[next_halfedge(half)]; };
    // 32 bits hold what there can be, and half as much memory is gone through
    std::vector<std::uint32_t> begin(vertex_span(faces, halves) + 1, 0);
    for (std::size_t h = 0; h < halves; ++h) ++begin[std::min(faces[h], end_of(h)) + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<std::pair<std::uint32_t, std::uint32_t>> sorted(halves);  // (higher vertex, half-edge)
    std::vector<std::uint32_t> filled(begin.begin(), begin.end());
    for (std::size_t h = 0; h < halves; ++h)
        sorted[filled[std::min(faces[h], end_of(h))]++] = {std::uint32_t(std::max(faces[h], end_of(h))), std::uint32_t(h)};
    EdgeTable table;
    table.face_edges.resize(halves);
    for (auto* pairs : {&table.edges, &table.edge_faces, &table.edge_halfedges}) pairs->reserve(halves / 2 + halves / 8);
    table.edge_count.reserve(halves / 2 + halves / 8);
    for (std::size_t low = 0; low + 1 < begin.size(); ++low) {
        std::sort(sorted.begin() + begin[low], sorted.begin() + begin[low + 1]);
        for (std::size_t at = begin[low]; at < begin[low + 1]; ++at) {
            const Index high = sorted[at].first, half = sorted[at].second;
            if (at == begin[low] || sorted[at - 1].first != sorted[at].first) {
                table.edges.push_back({Index(low), high});
                table.edge_halfedges.push_back({half, -1});
                table.edge_faces.push_back({half / 3, -1});
                table.edge_count.push_back(0);
            }
            if (++table.edge_count.back() == 2) {
                table.edge_halfedges.back()[1] = half;
                table.edge_faces.back()[1] = half / 3;
            }
            table.face_edges[half] = Index(table.edges.size()) - 1;
        }
    }
    for (std::size_t e = 0; e < table.edges.size(); ++e) {
        const auto [one, other] = table.edge_halfedges[e];
        table.manifold.push_back(table.edge_count[e] == 2 && faces[one] == end_of(other));
    }
    return table;
}

// Sets that are joined pair by pair; each is named by its lowest member.
class Sets {
   public:
    explicit Sets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }

    Index find(Index member) {
        while (parent_[member] != member) member = parent_[member] = parent_[parent_[member]];
        return member;
    }

    void join(Index one, Index other) {
        one = find(one), other = find(other);
        if (one < other) parent_[other] = one;
        else parent_[one] = other;
    }

   private:
    std::vector<Index> parent_;
};

// Labels 0, 1, … in the order of each set's lowest member.
inline std::vector<Index> numbered(Sets& sets, std::size_t count) {
    std::vector<Index> label(count);
    Index next = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const Index lowest = sets.find(Index(i));
        label[i] = lowest == Index(i) ? next++ : label[lowest];
    }
    return label;
}

struct Opened {
    std::vector<Index> faces, old;
};

// Each fan of faces that hang together along the joined edges gets a vertex of its own, in the order of the old ones.
inline Opened opened(const Index* faces, std::size_t count, const Index* edge_halfedges, const bool* joined,
                     std::size_t edges) {
    const std::size_t corners = 3 * count;
    Sets fans(corners);
    for (std::size_t e = 0; e < edges; ++e) {
        if (!joined[e]) continue;
        const Index one = edge_halfedges[2 * e], other = edge_halfedges[2 * e + 1];
        fans.join(next_halfedge(one), other);
        fans.join(next_halfedge(other), one);
    }
    std::vector<Index> start(vertex_span(faces, corners) + 1, 0), fresh(corners, -1);
    for (std::size_t c = 0; c < corners; ++c)
        if (fans.find(Index(c)) == Index(c)) ++start[faces[c] + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    Opened found;
    found.faces.resize(corners);
    found.old.resize(start.back());
    for (std::size_t c = 0; c < corners; ++c) {
        const Index lowest = fans.find(Index(c));
        if (lowest == Index(c)) {
            fresh[c] = start[faces[c]]++;
            found.old[fresh[c]] = faces[c];
        }
        found.faces[c] = fresh[lowest];
    }
    return found;
}

// Directed boundary edges: half-edges that have no other.
inline std::vector<Index> boundary_halfedges(const EdgeTable& table) {
    std::vector<Index> found;
    for (std::size_t e = 0; e < table.edges.size(); ++e)
        if (table.edge_count[e] == 1) found.push_back(table.edge_halfedges[e][0]);
    return found;
}

// The border as closed loops of vertices, longest first, then by lowest vertex.
// Only faces with a corner on it are taken apart: all fans of its vertices are there.
inline std::vector<std::vector<Index>> boundary_loops(const Index* faces, std::size_t count) {
    std::vector<char> rim(vertex_span(faces, 3 * count), 0);
    const EdgeTable whole = edge_table(faces, count);
    for (std::size_t e = 0; e < whole.edges.size(); ++e)
        if (!whole.manifold[e]) rim[whole.edges[e][0]] = rim[whole.edges[e][1]] = 1;
    std::vector<Index> near;
    for (std::size_t f = 0; f < count; ++f)
        if (rim[faces[3 * f]] || rim[faces[3 * f + 1]] || rim[faces[3 * f + 2]])
            near.insert(near.end(), faces + 3 * f, faces + 3 * f + 3);
    const EdgeTable table = edge_table(near.data(), near.size() / 3);
    std::vector<char> joined(table.manifold);
    const Opened split = opened(near.data(), near.size() / 3,
                                table.edge_halfedges.empty() ? nullptr : table.edge_halfedges[0].data(),
                                reinterpret_cast<const bool*>(joined.data()), joined.size());
    std::vector<Index> successor(split.old.size(), -1);
    for (Index half : boundary_halfedges(edge_table(split.faces.data(), near.size() / 3)))
        if (rim[near[half]] && rim[near[next_halfedge(half)]])
            successor[split.faces[half]] = split.faces[next_halfedge(half)];
    std::vector<std::vector<Index>> loops;
    for (std::size_t first = 0; first < successor.size(); ++first) {
        if (successor[first] < 0) continue;
        std::vector<Index> loop;
        for (Index at = Index(first); successor[at] >= 0;) {
            loop.push_back(split.old[at]);
            const Index next = successor[at];
            successor[at] = -1;
            at = next;
        }
        loops.push_back(std::move(loop));
    }
    std::stable_sort(loops.begin(), loops.end(), [](const auto& a, const auto& b) {
        if (a.size() != b.size()) return a.size() > b.size();
        return *std::min_element(a.begin(), a.end()) < *std::min_element(b.begin(), b.end());
    });
    return loops;
}

}  // namespace flexpara
