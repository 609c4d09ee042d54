// A piece of surface: its triangles at rest, and the Jacobians and energies of a flattening.
//
// v vertices (v, 3) · f faces (f, 3) · uv (v, 2), one after the other, in the surface's units.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace flexpara {

using Matrix2 = std::array<double, 4>;  // row by row
using Points3 = std::vector<std::array<double, 3>>;
using Faces = std::vector<std::array<int, 3>>;

// A triangle in its own plane.  gradient: of the function that is 1 at a corner and 0 at the other two.
struct Rest {
    double area;
    std::array<std::array<double, 2>, 3> gradient;
};

inline std::array<double, 3> difference(const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

inline double dot(const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

inline std::array<double, 3> cross(const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline Matrix2 product(const Matrix2& a, const Matrix2& b) {
    return {a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3]};
}

inline Rest rest_shape(const Points3& points, const std::array<int, 3>& face) {
    const auto first = difference(points[face[1]], points[face[0]]), second = difference(points[face[2]], points[face[0]]);
    const auto normal = cross(first, second);
    const double length = std::sqrt(dot(first, first)), doubled = std::sqrt(dot(normal, normal));
    const double height = doubled / length, foot = dot(first, second) / length;
    const double slope = foot / length / height;
    return {0.5 * doubled, {{{-1.0 / length, slope - 1.0 / height}, {1.0 / length, -slope}, {0.0, 1.0 / height}}}};
}

inline std::vector<Rest> rest_shapes(const Points3& points, const Faces& faces) {
    std::vector<Rest> found;
    found.reserve(faces.size());
    for (const auto& face : faces) found.push_back(rest_shape(points, face));
    return found;
}

inline Matrix2 jacobian(const Rest& rest, const std::array<int, 3>& face, const double* uv) {
    Matrix2 j{};
    for (int i = 0; i < 3; ++i) {
        const double u = uv[2 * face[i]], v = uv[2 * face[i] + 1];
        j[0] += rest.gradient[i][0] * u;
        j[1] += rest.gradient[i][1] * u;
        j[2] += rest.gradient[i][0] * v;
        j[3] += rest.gradient[i][1] * v;
    }
    return j;
}

// Σ area · (symmetric Dirichlet − 1), each face between 0 and `most`, which a flip or a collapse counts.
inline double excess_energy(const Points3& points, const Faces& faces, const double* uv, double most) {
    double sum = 0.0;
    for (const auto& face : faces) {
        const Rest rest = rest_shape(points, face);
        if (!(rest.area > 0.0)) continue;
        const Matrix2 j = jacobian(rest, face, uv);
        const double determinant = j[0] * j[3] - j[1] * j[2];
        const double norm = j[0] * j[0] + j[1] * j[1] + j[2] * j[2] + j[3] * j[3];
        const double energy = determinant > 0.0 ? norm * (1.0 + 1.0 / (determinant * determinant)) / 4.0 - 1.0 : most;
        sum += rest.area * std::clamp(energy, 0.0, most);
    }
    return sum;
}

}  // namespace flexpara
