// The compiled kernel as a Python module.  Arrays in, arrays out; Python's lock is released while anything is computed.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <limits>

#include "cloud.hpp"
#include "conformal.hpp"
#include "exact.hpp"
#include "nest.hpp"
#include "paths.hpp"
#include "polish.hpp"
#include "rigid.hpp"
#include "skyline.hpp"
#include "slim.hpp"
#include "topology.hpp"
#include "unfold.hpp"

namespace py = pybind11;
using namespace flexpara;

template <class T>
using Array = py::array_t<T, py::array::c_style | py::array::forcecast>;
using Numbers = Array<double>;
using Indices = Array<Index>;
using Mask = Array<bool>;

// Indices that are all in [0, bound): a wrong one is an error here too, not a crash.
static const Indices& checked(const Indices& indices, Index bound = std::numeric_limits<Index>::max()) {
    for (py::ssize_t i = 0; i < indices.size(); ++i)
        if (indices.data()[i] < 0 || indices.data()[i] >= bound) throw py::index_error("an index is out of range");
    return indices;
}

static void demand(bool holds, const char* fault) {
    if (!holds) throw py::value_error(fault);
}

static Points3 points_of(const Numbers& array) {
    Points3 points(array.shape(0));
    if (array.size()) std::copy_n(array.data(), array.size(), points[0].data());
    return points;
}

static Faces faces_of(const Indices& array) {
    Faces faces(array.shape(0));
    if (array.size()) std::copy_n(array.data(), array.size(), faces[0].data());
    return faces;
}

// values as an array of rows of so many; 0 for one dimension.
template <class T, class Source>
static py::array_t<T> array_of(const Source* values, std::size_t count, py::ssize_t row = 0) {
    std::vector<py::ssize_t> shape{py::ssize_t(count)};
    if (row) shape = {py::ssize_t(count) / row, row};
    py::array_t<T> array(shape);
    std::copy_n(values, count, array.mutable_data());
    return array;
}

template <class T>
static py::array_t<T> array_of(const std::vector<T>& values, py::ssize_t row = 0) {
    return array_of<T>(values.data(), values.size(), row);
}

static py::array_t<Index> pairs_of(const std::vector<std::array<Index, 2>>& pairs) {
    return array_of<Index>(pairs.empty() ? nullptr : pairs[0].data(), 2 * pairs.size(), 2);
}

// A matrix of scipy's, in rows.
static Rows rows_of(const py::object& matrix) {
    const auto begin = matrix.attr("indptr").cast<Array<int>>(), column = matrix.attr("indices").cast<Array<int>>();
    const auto value = matrix.attr("data").cast<Numbers>();
    return {{begin.data(), begin.data() + begin.size()},
            {column.data(), column.data() + column.size()},
            {value.data(), value.data() + value.size()}};
}

static void define_solvers(py::module_& module) {
    py::class_<TwoLevel>(module, "TwoLevel")
        .def(py::init([](const py::object& matrix, const py::object& weights, double tolerance, int most, int threads) {
            const Rows all = rows_of(matrix), shares = rows_of(weights);
            const int coarse = weights.attr("shape").cast<std::pair<int, int>>().second;
            py::gil_scoped_release free;
            return TwoLevel(all, shares, coarse, tolerance, most, threads);
        }))
        .def("solve", [](const TwoLevel& solver, const Numbers& right, const Numbers& start, double size) {
            TwoLevel::Pairs wanted(right.shape(0)), found(right.shape(0));
            if (right.size()) {
                std::copy_n(right.data(), right.size(), wanted[0].data());
                std::copy_n(start.data(), start.size(), found[0].data());
            }
            {
                py::gil_scoped_release free;
                solver.solve(wanted, found, size);
            }
            return array_of<double>(found.empty() ? nullptr : found[0].data(), 2 * found.size(), 2);
        });
    py::class_<Rigid>(module, "Rigid")
        .def(py::init([](const Numbers& points, const Indices& faces, int threads) {
            auto vertices = points_of(points);
            auto corners = faces_of(checked(faces, points.shape(0)));
            py::gil_scoped_release free;
            return Rigid(vertices, std::move(corners), threads);
        }))
        .def("stiffness", [](const Rigid& of) {  // values, columns, where rows begin: as scipy takes them
            const Rows found = of.stiffness();
            return py::make_tuple(array_of(found.value), array_of(found.column), array_of(found.begin));
        })
        .def("jacobians", [](const Rigid& of, const Numbers& uv) {
            demand(uv.size() == 2 * of.vertices(), "uv of another piece");
            py::array_t<double> found({of.faces(), py::ssize_t(2), py::ssize_t(2)});
            double* into = found.mutable_data();
            py::gil_scoped_release free;
            of.jacobians(uv.data(), into);
            return found;
        })
        .def("right", [](const Rigid& of, const Numbers& turn) {
            demand(turn.size() == 4 * of.faces(), "Jacobians of another piece");
            py::array_t<double> found({of.vertices(), py::ssize_t(2)});
            double* into = found.mutable_data();
            py::gil_scoped_release free;
            of.right(turn.data(), into);
            return found;
        });
}

static void define_pieces(py::module_& module) {
    py::class_<Slim>(module, "Slim")
        .def(py::init([](const Numbers& points, const Indices& faces, const Numbers& uv) {
            auto vertices = points_of(points);
            auto corners = faces_of(checked(faces, std::min(points.shape(0), uv.shape(0))));
            std::vector<double> start(uv.data(), uv.data() + uv.size());
            py::gil_scoped_release free;
            return Slim(vertices, corners, std::move(start));
        }))
        .def(py::init([](const Numbers& points, const Indices& faces, const Numbers& uv, const Indices& scaffold, double weight) {
            auto vertices = points_of(points);
            auto corners = faces_of(checked(faces, std::min(points.shape(0), uv.shape(0))));
            auto around = faces_of(checked(scaffold, uv.shape(0)));
            std::vector<double> start(uv.data(), uv.data() + uv.size());
            py::gil_scoped_release free;
            return Slim(vertices, corners, std::move(start), around, weight);
        }))
        .def("pin", &Slim::pin)
        .def("run", [](Slim& slim, int iterations) {
            {
                py::gil_scoped_release free;
                slim.run(iterations);
            }
            return array_of(slim.uv(), 2);
        });
    // uv (v, 2) after so many sweeps over the vertices with a face around them whose excess energy is above so much.
    module.def("polished", [](const Numbers& points, const Indices& faces, const Numbers& uv, int sweeps, double above) {
        demand(uv.shape(0) == points.shape(0), "uv of another piece");
        Polish polish(points_of(points), faces_of(checked(faces, points.shape(0))),
                      std::vector<double>(uv.data(), uv.data() + uv.size()));
        {
            py::gil_scoped_release free;
            polish.run(sweeps, above);
        }
        return array_of(polish.uv(), 2);
    });
    module.def("excess_energy", [](const Numbers& points, const Indices& faces, const Numbers& uv, double most) {
        return excess_energy(points_of(points), faces_of(checked(faces, std::min(points.shape(0), uv.shape(0)))), uv.data(), most);
    });
    py::class_<Conformal>(module, "Conformal")
        .def(py::init([](const Numbers& points, const Indices& faces, double least, double steepest) {
            return Conformal(points_of(points), checked(faces, points.shape(0)).data(), faces.shape(0), least, steepest);
        }))
        .def("turn", [](const Conformal& of) { return array_of(of.turn()); })
        .def("fan", [](const Conformal& of) { return array_of(of.fan()); })
        .def("factor", [](Conformal& of, const Mask& rim) {
            std::vector<double> found;
            {
                py::gil_scoped_release free;
                found = of.factor(rim.data());
            }
            return array_of(found);
        })
        .def("product", [](const Conformal& of, const Numbers& u) { return array_of(of.product(u.data())); })
        .def("harmonic", [](Conformal& of, const Mask& rim, const Numbers& values) {
            auto found = array_of<double>(values.data(), values.size());
            of.harmonic(rim.data(), found.mutable_data());
            return found;
        });
}

static void define_overlap(py::module_& module) {
    // (f, 3, 2) → (p, 2), sorted; None where a coordinate is out of range.
    module.def("overlapping_pairs", [](const Numbers& uv) -> py::object {
        std::vector<std::array<Index, 2>> found;
        try {
            py::gil_scoped_release free;
            Overlaps(uv.data(), uv.shape(0)).each([&](Index a, Index b) {
                found.push_back({a, b});
                return true;
            });
            std::sort(found.begin(), found.end());
        } catch (const OutOfRange&) {
            return py::none();
        }
        return pairs_of(found);
    });
    module.def("overlaps_anywhere", [](const Numbers& uv) -> py::object {
        bool any = false;
        try {
            py::gil_scoped_release free;
            Overlaps(uv.data(), uv.shape(0)).each([&](Index, Index) { return !(any = true); });
        } catch (const OutOfRange&) {
            return py::none();
        }
        return py::bool_(any);
    });
    module.def("orientation_sign", [](const Numbers& a, const Numbers& b, const Numbers& c) -> py::object {
        py::array_t<std::int8_t> sign(a.shape(0));
        auto at = [](const Numbers& of, py::ssize_t i) { return Point{of.data()[2 * i], of.data()[2 * i + 1]}; };
        try {
            for (const auto* of : {&a, &b, &c}) check_range(of->data(), of->size());
        } catch (const OutOfRange&) {
            return py::none();
        }
        for (py::ssize_t i = 0; i < a.shape(0); ++i)
            sign.mutable_data()[i] = std::int8_t(orientation(at(a, i), at(b, i), at(c, i)));
        return sign;
    });
}

static void define_topology(py::module_& module) {
    module.def("edge_table", [](const Indices& faces) {
        EdgeTable table;
        checked(faces);
        {
            py::gil_scoped_release free;
            table = edge_table(faces.data(), faces.shape(0));
        }
        return py::make_tuple(pairs_of(table.edges), array_of(table.face_edges, 3), pairs_of(table.edge_faces),
                              pairs_of(table.edge_halfedges), array_of(table.edge_count),
                              array_of<bool>(table.manifold.data(), table.manifold.size()));
    });
    module.def("opened", [](const Indices& faces, const Indices& halfedges, const Mask& joined) {
        Opened found;
        checked(faces);
        {
            py::gil_scoped_release free;
            found = opened(faces.data(), faces.shape(0), halfedges.data(), joined.data(), joined.size());
        }
        return py::make_tuple(array_of(found.faces, 3), array_of(found.old));
    });
    module.def("boundary_loops", [](const Indices& faces) {
        py::list loops;
        for (const auto& loop : boundary_loops(checked(faces).data(), faces.shape(0))) loops.append(array_of(loop));
        return loops;
    });
    module.def("boundary_edges", [](const Indices& faces) {
        std::vector<std::array<Index, 2>> found;
        for (Index half : boundary_halfedges(edge_table(checked(faces).data(), faces.shape(0))))
            found.push_back({faces.data()[half], faces.data()[next_halfedge(half)]});
        return pairs_of(found);
    });
    module.def("face_components", [](Index count, const Indices& pairs) {
        Sets sets(count);
        checked(pairs, count);
        for (py::ssize_t i = 0; i < pairs.shape(0); ++i) sets.join(pairs.data()[2 * i], pairs.data()[2 * i + 1]);
        return array_of(numbered(sets, count));
    });
    module.def("shortest_paths", [](Index count, const Indices& edges, const Numbers& cost, const Indices& sources) {
        Paths found;
        checked(edges, count);
        checked(sources, count);
        {
            py::gil_scoped_release free;
            found = shortest_paths(count, edges.data(), cost.data(), cost.size(), sources.data(), sources.size());
        }
        return py::make_tuple(array_of(found.distance), array_of(found.parent));
    });
}

static Cloud cloud_of(const Numbers& points, const Indices& neighbours) {
    checked(neighbours, points.shape(0));
    demand(neighbours.shape(0) == points.shape(0) && points.shape(1) == 3, "neighbours of other points");
    return {points.data(), neighbours.data(), std::size_t(points.shape(0)), std::size_t(neighbours.shape(1))};
}

static void define_clouds(py::module_& module) {
    module.def("planes", [](const Numbers& points, const Indices& neighbours, const Numbers& weight,
                            const Numbers& scale, int rounds, int threads) {
        const Cloud cloud = cloud_of(points, neighbours);
        demand(weight.shape(0) == points.shape(0) && weight.shape(1) <= neighbours.shape(1) &&
               scale.size() == points.shape(0), "weights of other neighbours");
        py::array_t<double> normals({points.shape(0), py::ssize_t(3)});
        double* into = normals.mutable_data();
        py::gil_scoped_release free;
        planes(cloud, weight.shape(1), weight.data(), scale.data(), rounds, threads, into);
        return normals;
    });
    // (t, 3); across, along: the frame of each point's plane; most, opposite, steep: of CloudConfig.
    module.def("stars", [](const Numbers& points, const Indices& neighbours, const Numbers& across,
                           const Numbers& along, const Numbers& normals, int most, double opposite, double steep,
                           int threads) {
        const Cloud cloud = cloud_of(points, neighbours);
        for (const auto* of : {&across, &along, &normals})
            demand(of->size() == points.size(), "frames of other points");
        std::vector<Index> found;
        {
            py::gil_scoped_release free;
            found = stars(cloud, across.data(), along.data(), normals.data(), {most, opposite, steep}, threads);
        }
        return array_of(found, 3);
    });
}

static void define_unfolding(py::module_& module) {
    // (f,) numbers, (f, 3, 2) uv, and by number the length of the border; None where a coordinate is out of range.
    // region: (f,) from 0 on.  uv: each region laid flat.  length: of the edges of `edge_table`.  The rest: UnfoldLimits.
    module.def("unfold", [](const Indices& faces, const Indices& region, const Numbers& uv, const Numbers& length,
                            const Numbers& limits) -> py::object {
        checked(faces);
        checked(region, faces.shape(0));
        demand(region.size() == faces.shape(0) && uv.size() == 2 * faces.size(), "regions of other faces");
        demand(limits.size() == 8, "other limits");
        const double* of = limits.data();
        Unfolding work(faces.data(), faces.shape(0), region.data(), uv.data(), length.data(), std::size_t(length.size()),
                       {of[0], of[1], of[2], of[3], of[4], of[5], of[6], of[7]});
        try {
            py::gil_scoped_release free;
            work.run();
        } catch (const OutOfRange&) {
            return py::none();
        }
        const double* places = work.uv().empty() ? nullptr : work.uv()[0].data();
        return py::make_tuple(array_of(work.label()), array_of<double>(places, 2 * work.uv().size(), 2),
                              array_of(work.perimeter()));
    });
}

static void define_packing(py::module_& module) {
    // low, high: of all profiles one after the other; width, top, room: by profile; begin: the first of each chart.
    module.def("drop", [](const Numbers& low, const Numbers& high, const Indices& width, const Numbers& top,
                          const Numbers& room, const Indices& begin, const Indices& order, Index columns,
                          double tightness, double most) -> py::object {
        const std::size_t charts = order.size();
        demand(begin.size() == order.size() + 1 && low.size() == high.size() && top.size() == width.size() &&
               room.size() == width.size(), "profiles of other charts");
        checked(begin, width.size() + 1);
        checked(order, charts);
        std::vector<Profile> profiles;
        Index at = 0;
        for (py::ssize_t i = 0; i < width.size(); at += width.data()[i++]) {
            demand(width.data()[i] > 0 && at + width.data()[i] <= low.size(), "profiles of other widths");
            profiles.push_back({low.data() + at, high.data() + at, width.data()[i], top.data()[i], room.data()[i]});
        }
        Drop found;
        {
            py::gil_scoped_release free;
            found = drop(profiles, begin.data(), order.data(), charts, columns, tightness, most);
        }
        if (found.skyline.empty()) return py::none();
        return py::make_tuple(array_of(found.angle), array_of(found.origin, 2), array_of(found.skyline));
    });
}

static void define_nesting(py::module_& module) {
    // masks: a list of (h, w) arrays a chart.  (layouts, k, 3): turn, column and row of each chart.
    module.def("shrunk", [](const py::list& masks, int quarters, std::array<double, 2> share, const Indices& start,
                            const py::tuple& numbers, std::uint64_t seed) {
        std::vector<std::vector<Bitmap>> charts;
        Lying first;
        demand(start.ndim() == 2 && start.shape(0) == py::ssize_t(masks.size()) && start.shape(1) == 3 &&
               masks.size() > 1, "a start of other charts");
        for (const auto& turns : masks) {
            std::vector<Bitmap> own;
            for (const auto& one : turns) {
                const auto cells = py::cast<Mask>(one);
                demand(cells.ndim() == 2 && cells.size() > 0 && cells.size() < (1 << 24), "cells of no bitmap");
                own.emplace_back(cells.data(), int(cells.shape(0)), int(cells.shape(1)));
            }
            const Index* at = start.data() + 3 * charts.size();
            demand(quarters > 0 && own.size() % quarters == 0 && at[0] >= 0 && at[0] < Index(own.size()) && own.size() < (1 << 16),
                   "a turn that no mask has");
            first.turn.push_back(int(at[0]));
            first.place.push_back({int(at[1]), int(at[2])});
            charts.push_back(std::move(own));
        }
        const Separating asked{numbers[0].cast<double>(), numbers[1].cast<int>(), numbers[2].cast<int>(),
                               numbers[3].cast<int>(), numbers[4].cast<int>(), numbers[5].cast<float>(),
                               numbers[6].cast<float>(), numbers[7].cast<float>(), numbers[8].cast<std::size_t>()};
        std::vector<Lying> found;
        {
            py::gil_scoped_release free;
            found = Separation(std::move(charts), quarters, share, asked, seed).shrunk(std::move(first));
        }
        std::vector<Index> flat;
        for (const auto& one : found)
            for (std::size_t i = 0; i < one.turn.size(); ++i)
                flat.insert(flat.end(), {one.turn[i], one.place[i][0], one.place[i][1]});
        return array_of(flat, 3);
    });
}

PYBIND11_MODULE(compiled, module) {
    module.doc() = "Kernels of flexpara in C++; each has a twin in Python that says what it does.";
    module.attr("edition") = 12;
    define_pieces(module);
    define_solvers(module);
    define_overlap(module);
    define_topology(module);
    define_clouds(module);
    define_packing(module);
    define_unfolding(module);
    define_nesting(module);
}
