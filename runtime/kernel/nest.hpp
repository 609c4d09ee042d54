// Charts as bitmaps on a page that shrinks: overlaps are removed chart by chart, guided by weights of pairs.
// What is computed is said where its twin is: runtime/pack/layouts/separation.py.   Cells are the unit of length.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

namespace flexpara {

// Numbers of the search; see SeparationConfig.
struct Separating {
    double work;
    int turns, patience, step, kept;
    float heavier, steeper, lighter;
    std::size_t memory;
};

struct Bitmap {
    struct Run {
        int row, first, length;
    };
    int width = 0, height = 0;
    std::vector<std::uint8_t> cells;
    std::vector<Run> runs;

    Bitmap(const bool* from, int rows, int columns) : width(columns), height(rows), cells(from, from + rows * columns) {
        for (int y = 0; y < rows; ++y)
            for (int x = 0; x < columns;) {
                const int first = x;
                while (x < columns && cells[y * columns + x]) ++x;
                if (x > first) runs.push_back({y, first, x - first});
                else ++x;
            }
    }
};

// How deep one chart lies in another, for each shift of the one against the other: cells, by steps along the axes.
struct Depths {
    int width = 0, height = 0;
    std::vector<std::uint8_t> depth;

    Depths(int columns, int rows) : width(columns), height(rows), depth(std::size_t(columns) * rows) {}

    Depths flipped() const {
        Depths found(width, height);
        std::reverse_copy(depth.begin(), depth.end(), found.depth.begin());
        return found;
    }

    // By 90°, counter-clockwise.
    Depths turned() const {
        Depths found(height, width);
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) found.depth[std::size_t(x) * height + height - 1 - y] = depth[std::size_t(y) * width + x];
        return found;
    }
};

// Bit (x, y): the one overlaps the other where it lies x − (its width − 1), y − (its height − 1) from it.
inline Depths depths_of(const Bitmap& one, const Bitmap& other) {
    Depths found(one.width + other.width - 1, one.height + other.height - 1);
    const int words = (found.width + 63) / 64;
    std::vector<std::vector<std::uint64_t>> spread(1, std::vector<std::uint64_t>(std::size_t(words) * other.height, 0));
    for (const auto& run : other.runs)
        for (int x = run.first; x < run.first + run.length; ++x)
            spread[0][std::size_t(run.row) * words + x / 64] |= std::uint64_t(1) << (x % 64);
    auto shifted = [&](const std::uint64_t* from, int by, std::uint64_t* into) {  // into |= from << by
        const int far = by / 64, bits = by % 64;
        for (int w = words - 1; w >= far; --w) {
            std::uint64_t value = from[w - far] << bits;
            if (bits && w > far) value |= from[w - far - 1] >> (64 - bits);
            into[w] |= value;
        }
    };
    for (int power = 1; power < one.width; power *= 2) {
        std::vector<std::uint64_t> next(spread.back());
        for (int y = 0; y < other.height; ++y)
            shifted(&spread.back()[std::size_t(y) * words], power, &next[std::size_t(y) * words]);
        spread.push_back(std::move(next));
    }
    std::vector<std::uint64_t> hit(std::size_t(words) * found.height, 0);
    for (const auto& run : one.runs) {
        int power = 0;
        while (2 << power <= run.length) ++power;
        const int near = one.width - run.first - run.length, far = near + run.length - (1 << power);
        for (int y = 0; y < other.height; ++y) {
            std::uint64_t* into = &hit[std::size_t(y - run.row + one.height - 1) * words];
            const std::uint64_t* from = &spread[power][std::size_t(y) * words];
            shifted(from, near, into);
            if (far != near) shifted(from, far, into);
        }
    }
    const int w = found.width, h = found.height;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
            found.depth[std::size_t(y) * w + x] = (hit[std::size_t(y) * words + x / 64] >> (x % 64) & 1) ? 255 : 0;
    auto nearer = [](std::uint8_t here, std::uint8_t before) {
        return std::min<std::uint8_t>(here, std::uint8_t(before + (before < 255)));
    };
    const std::vector<std::uint8_t> outside(w, 0);
    for (int y = 0; y < h; ++y) {
        std::uint8_t* row = &found.depth[std::size_t(y) * w];
        const std::uint8_t* before = y ? row - w : outside.data();
        for (int x = 0; x < w; ++x) row[x] = nearer(row[x], before[x]);
    }
    for (int y = h - 1; y >= 0; --y) {
        std::uint8_t* row = &found.depth[std::size_t(y) * w];
        const std::uint8_t* before = y < h - 1 ? row + w : outside.data();
        for (int x = 0; x < w; ++x) row[x] = nearer(row[x], before[x]);
        for (int x = 0; x < w; ++x) row[x] = nearer(row[x], x ? row[x - 1] : 0);
        for (int x = w - 1; x >= 0; --x) row[x] = nearer(row[x], x < w - 1 ? row[x + 1] : 0);
    }
    return found;
}

// SplitMix64 (Steele, Lea, Flood 2014): the same numbers on every machine.
class Chance {
   public:
    explicit Chance(std::uint64_t seed) : state_(seed) {}

    std::uint64_t below(std::uint64_t bound) {
        std::uint64_t mixed = state_ += 0x9E3779B97F4A7C15u;
        mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9u;
        mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBu;
        return ((mixed ^ (mixed >> 31)) >> 33) % bound;
    }

   private:
    std::uint64_t state_;
};

// Where charts lie: which of its turns each has, and its lower left corner.
struct Lying {
    std::vector<int> turn;
    std::vector<std::array<int, 2>> place;
};

class Separation {
   public:
    // masks[chart]: slants times quarter turns, those of a slant behind each other.  share: of the page's sides.
    Separation(std::vector<std::vector<Bitmap>> masks, int quarters, std::array<double, 2> share,
               const Separating& numbers, std::uint64_t seed)
        : masks_(std::move(masks)), quarters_(quarters), share_(share), numbers_(numbers), chance_(seed),
          left_(numbers.work) {}

    // Layouts on smaller and smaller pages, the last one best.
    std::vector<Lying> shrunk(Lying now) {
        std::vector<Lying> found;
        Lying good = now;
        int step = numbers_.step;
        while (left_ > 0) {
            left_ -= 1e4;
            const double side = std::ceil(side_of(good)) - step;
            page_ = {int(side * share_[0]), int(side * share_[1])};
            if (pushed_in(now) && separated(now)) {
                good = now;
                found.push_back(good);
                if (found.size() > std::size_t(numbers_.kept)) found.erase(found.begin());
            } else {
                step = 1;
                now = swapped(good);
            }
        }
        return found;
    }

   private:
    std::vector<std::vector<Bitmap>> masks_;
    int quarters_;
    std::array<double, 2> share_;
    Separating numbers_;
    Chance chance_;
    double left_;
    std::array<int, 2> page_{};
    std::unordered_map<std::uint64_t, std::unique_ptr<Depths>> known_;
    std::size_t held_ = 0;
    std::vector<float> cost_;
    std::vector<float> weight_;
    std::vector<int> depth_;

    std::size_t count() const { return masks_.size(); }

    const Bitmap& mask(const Lying& now, std::size_t chart) const { return masks_[chart][now.turn[chart]]; }

    double side_of(const Lying& now) const {
        double side = 0.0;
        for (std::size_t i = 0; i < count(); ++i) {
            side = std::max(side, (now.place[i][0] + mask(now, i).width) / share_[0]);
            side = std::max(side, (now.place[i][1] + mask(now, i).height) / share_[1]);
        }
        return side;
    }

    // Charts moved into the page; false where one is larger than it.
    bool pushed_in(Lying& now) const {
        bool fits = true;
        for (std::size_t i = 0; i < count(); ++i) {
            const int room[2] = {page_[0] - mask(now, i).width, page_[1] - mask(now, i).height};
            for (int axis : {0, 1}) {
                fits = fits && room[axis] >= 0;
                now.place[i][axis] = std::max(std::min(now.place[i][axis], room[axis]), 0);
            }
        }
        return fits;
    }

    // Two charts change places, at turns by chance.
    Lying swapped(const Lying& good) {
        Lying now = good;
        const int one = int(chance_.below(count())), other = int((one + 1 + chance_.below(count() - 1)) % count());
        for (auto [from, to] : {std::pair{one, other}, std::pair{other, one}}) {
            now.turn[from] = int(chance_.below(masks_[from].size()));
            for (int axis : {0, 1}) {
                auto size = [&](const Bitmap& of) { return axis == 0 ? of.width : of.height; };
                const int middle = 2 * good.place[to][axis] + size(mask(good, to));
                now.place[from][axis] = std::max(middle - size(mask(now, from)), 0) / 2;
            }
        }
        return now;
    }

    const Depths& depths(int one, int turn, int other, int against) {
        const std::uint64_t key = ((std::uint64_t(one) << 16 | turn) << 32) | (std::uint64_t(other) << 16 | against);
        const auto at = known_.find(key);
        if (at != known_.end()) return *at->second;
        std::unique_ptr<Depths> made;
        if (one > other) {
            made = std::make_unique<Depths>(depths(other, against, one, turn).flipped());
        } else if (const int quarter = turn % quarters_; quarter) {
            const int back = against - against % quarters_ + (against + quarters_ - quarter) % quarters_;
            const Depths* from = &depths(one, turn - quarter, other, back);
            Depths turned = from->turned();
            for (int more = 1; more < quarter; ++more) turned = turned.turned();
            made = std::make_unique<Depths>(std::move(turned));
        } else {
            made = std::make_unique<Depths>(depths_of(masks_[one][turn], masks_[other][against]));
            left_ -= 4.0 * double(made->depth.size());
        }
        left_ -= double(made->depth.size());
        held_ += made->depth.size();
        return *(known_[key] = std::move(made));
    }

    int depth(const Lying& now, int one, int other) {
        const Depths& table = depths(one, now.turn[one], other, now.turn[other]);
        const int x = now.place[one][0] - now.place[other][0] + mask(now, one).width - 1;
        const int y = now.place[one][1] - now.place[other][1] + mask(now, one).height - 1;
        return x >= 0 && y >= 0 && x < table.width && y < table.height ? table.depth[std::size_t(y) * table.width + x] : 0;
    }

    struct Place {
        float cost;
        int turn, x, y;
    };

    // The place where a chart at that turn costs least, by chance one of several; false where it is too large.
    bool best_place(const Lying& now, int chart, int turn, Place& best) {
        const Bitmap& own = masks_[chart][turn];
        const int columns = page_[0] - own.width + 1, rows = page_[1] - own.height + 1;
        if (columns <= 0 || rows <= 0) return false;
        cost_.assign(std::size_t(columns) * rows, 0.0f);
        left_ -= 2.0 * double(cost_.size());
        for (int other = 0; other < int(count()); ++other) {
            if (other == chart) continue;
            const Depths& table = depths(chart, turn, other, now.turn[other]);
            const int left = now.place[other][0] - (own.width - 1), low = now.place[other][1] - (own.height - 1);
            const int first = std::max(left, 0), end = std::min(left + table.width, columns);
            const float weight = weight_[std::size_t(chart) * count() + other];
            for (int y = std::max(low, 0); y < std::min(low + table.height, rows); ++y) {
                const std::uint8_t* from = &table.depth[std::size_t(y - low) * table.width];
                float* into = &cost_[std::size_t(y) * columns];
                for (int x = first; x < end; ++x) into[x] += weight * float(from[x - left]);
                left_ -= std::max(end - first, 0);
            }
        }
        const float least = *std::min_element(cost_.begin(), cost_.end());
        const auto equal = std::uint64_t(std::count(cost_.begin(), cost_.end(), least));
        auto at = std::find(cost_.begin(), cost_.end(), least);
        for (std::uint64_t skip = chance_.below(equal); skip; --skip) at = std::find(at + 1, cost_.end(), least);
        const int cell = int(at - cost_.begin());
        best = {least, turn, cell % columns, cell / columns};
        return true;
    }

    // The turn a chart has, its neighbours, and some by chance; all where there are few.
    std::vector<int> turns_tried(int chart, int turn) {
        const int all = int(masks_[chart].size()), slants = all / quarters_;
        std::vector<int> tried;
        if (all <= numbers_.turns + 3) {
            for (int each = 0; each < all; ++each) tried.push_back(each);
            return tried;
        }
        auto turn_at = [&](int rank) { return rank % all % slants * quarters_ + rank % all / slants; };
        const int rank = turn % quarters_ * slants + turn / quarters_;
        for (int step : {0, 1, all - 1}) tried.push_back(turn_at(rank + step));
        for (int each = 0; each < numbers_.turns; ++each) tried.push_back(int(chance_.below(std::uint64_t(all))));
        return tried;
    }

    void moved(Lying& now, int chart) {
        Place best{0.0f, -1, 0, 0}, found{};
        for (int turn : turns_tried(chart, now.turn[chart]))
            if (best_place(now, chart, turn, found) && (best.turn < 0 || found.cost < best.cost)) best = found;
        if (best.turn < 0) return;
        now.turn[chart] = best.turn;
        now.place[chart] = {best.x, best.y};
        measured(now, chart);
    }

    void measured(const Lying& now, int chart) {
        const int k = int(count());
        for (int other = 0; other < k; ++other)
            if (other != chart) depth_[chart * k + other] = depth_[other * k + chart] = depth(now, chart, other);
    }

    bool collides(int chart) const {
        const auto row = depth_.begin() + std::ptrdiff_t(chart * count());
        return std::any_of(row, row + std::ptrdiff_t(count()), [](int deep) { return deep > 0; });
    }

    void weighted() {
        const int deepest = *std::max_element(depth_.begin(), depth_.end());
        for (std::size_t i = 0; i < depth_.size(); ++i) {
            const float share = float(depth_[i]) / float(deepest);
            const float factor = depth_[i] > 0 ? numbers_.heavier + numbers_.steeper * share : numbers_.lighter;
            weight_[i] = std::max(weight_[i] * factor, 1.0f);
        }
    }

    // Whether all overlaps could be removed.
    bool separated(Lying& now) {
        const int k = int(count());
        weight_.assign(std::size_t(k) * k, 1.0f);
        depth_.assign(std::size_t(k) * k, 0);
        for (int i = 0; i < k; ++i) measured(now, i);
        double least = INFINITY;
        for (int stale = 0; stale <= numbers_.patience && left_ > 0; ++stale) {
            if (held_ > numbers_.memory) known_.clear(), held_ = 0;
            std::vector<int> order(k);
            for (int i = 0; i < k; ++i) order[i] = i;
            for (int i = k - 1; i > 0; --i) std::swap(order[i], order[chance_.below(std::uint64_t(i) + 1)]);
            for (int chart : order)
                if (collides(chart)) moved(now, chart);
            double total = 0.0;
            for (int deep : depth_) total += deep;
            if (total == 0.0) return true;
            if (total < least) least = total, stale = -1;
            weighted();
        }
        return false;
    }
};

}  // namespace flexpara
