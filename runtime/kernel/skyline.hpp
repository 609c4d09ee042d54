// Charts dropped one after the other onto a skyline, profile on profile.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "topology.hpp"

namespace flexpara {

// A chart at one angle: lowest and highest points of its columns, the highest of all, and the sum of the lowest.
struct Profile {
    const double *low, *high;
    Index width;
    double top, room;
};

// Of each chart the number of its angle and the origin of its profile; the skyline reached.  Empty where one is wider
// than the columns, or the height exceeds the most.
struct Drop {
    std::vector<Index> angle;
    std::vector<double> origin, skyline;
};

class Skyline {
   public:
    // tightness: what a column buried to a height of one counts, by column.
    Skyline(Index columns, double tightness)
        : height_(columns, 0.0), below_(columns + 1, 0.0), rest_(columns), tightness_(tightness) {}

    // Of the profiles from first to last the one that lies best, put there: its number, −1 where none fits.
    Index take(const Profile* first, const Profile* last, double* origin, double* top) {
        for (std::size_t i = 0; i < height_.size(); ++i) below_[i + 1] = below_[i] + height_[i];
        double least = INFINITY;
        Index best = -1, place = 0;
        for (const Profile* shape = first; shape != last; ++shape)
            if (shape->width <= Index(height_.size()) && look(*shape, least, place, origin[1])) best = shape - first;
        if (best < 0) return best;
        const Profile& shape = first[best];
        origin[0] = double(place);
        for (Index i = 0; i < shape.width; ++i) height_[place + i] = origin[1] + shape.high[i];
        *top = origin[1] + shape.top;
        return best;
    }

    const std::vector<double>& height() const { return height_; }

   private:
    // Whether a profile lies better somewhere than at the least cost so far; if so, that cost, where and how high.
    bool look(const Profile& shape, double& least, Index& place, double& height) {
        const Index places = Index(height_.size()) - shape.width + 1;
        for (Index p = 0; p < places; ++p) rest_[p] = height_[p] - shape.low[0];
        for (Index i = 1; i < shape.width; ++i) {
            const double* above = height_.data() + i;
            const double low = shape.low[i];
            for (Index p = 0; p < places; ++p) {
                const double reach = above[p] - low;
                rest_[p] = reach > rest_[p] ? reach : rest_[p];
            }
        }
        const double own = shape.top + tightness_ * shape.room, width = double(shape.width);
        bool better = false;
        for (Index p = 0; p < places; ++p) {
            const double buried = width * rest_[p] - (below_[p + shape.width] - below_[p]);
            const double cost = rest_[p] + tightness_ * buried + own;
            if (!(cost < least)) continue;
            better = true;
            least = cost;
            place = p;
            height = rest_[p];
        }
        return better;
    }

    std::vector<double> height_, below_, rest_;
    double tightness_;
};

// profiles: those of chart c from begin[c] to begin[c + 1].  order: of the charts.  most: height at which to give up.
inline Drop drop(const std::vector<Profile>& profiles, const Index* begin, const Index* order, std::size_t charts,
                 Index columns, double tightness, double most) {
    Skyline skyline(columns, tightness);
    Drop found{std::vector<Index>(charts, 0), std::vector<double>(2 * charts, 0.0), {}};
    for (std::size_t i = 0; i < charts; ++i) {
        const Index chart = order[i];
        double top = 0.0;
        found.angle[chart] = skyline.take(profiles.data() + begin[chart], profiles.data() + begin[chart + 1],
                                          found.origin.data() + 2 * chart, &top);
        if (found.angle[chart] < 0 || top > most) return {};
    }
    found.skyline = skyline.height();
    return found;
}

}  // namespace flexpara
