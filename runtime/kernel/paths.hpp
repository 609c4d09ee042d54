// Shortest paths along the edges of a mesh (Dijkstra), from the nearest of some sources.
#pragma once

#include <cmath>
#include <queue>

#include "topology.hpp"

namespace flexpara {

// Of each vertex: the distance from the nearest source, and the vertex before it; −1 at sources and out of reach.
struct Paths {
    std::vector<double> distance;
    std::vector<Index> parent;
};

inline Paths shortest_paths(std::size_t count, const Index* edges, const double* cost, std::size_t edge_count,
                            const Index* sources, std::size_t source_count) {
    std::vector<Index> begin(count + 1, 0), other(2 * edge_count);
    std::vector<double> step(2 * edge_count);
    for (std::size_t i = 0; i < 2 * edge_count; ++i) ++begin[edges[i] + 1];
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<Index> filled(begin.begin(), begin.end() - 1);
    for (std::size_t i = 0; i < 2 * edge_count; ++i) {
        const Index at = filled[edges[i]]++;
        other[at] = edges[i ^ 1];
        step[at] = cost[i / 2];
    }
    Paths found{std::vector<double>(count, INFINITY), std::vector<Index>(count, -1)};
    using Entry = std::pair<double, Index>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (std::size_t i = 0; i < source_count; ++i) {
        found.distance[sources[i]] = 0.0;
        queue.emplace(0.0, sources[i]);
    }
    while (!queue.empty()) {
        const auto [far, vertex] = queue.top();
        queue.pop();
        if (far > found.distance[vertex]) continue;
        for (Index at = begin[vertex]; at < begin[vertex + 1]; ++at) {
            const double reached = far + step[at];
            if (!(reached < found.distance[other[at]])) continue;
            found.distance[other[at]] = reached;
            found.parent[other[at]] = vertex;
            queue.emplace(reached, other[at]);
        }
    }
    return found;
}

}  // namespace flexpara
