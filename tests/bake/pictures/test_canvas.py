"""The canvas shows what is in front, upright, in its own colour."""

from __future__ import annotations

import moderngl
import numpy as np

from flexpara.bake.pictures.canvas import LIFT, MARGIN, Camera, Lines, Shape, draw, three_quarter_axes

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
NO_LINES = Lines(np.zeros((0, 2, 3)), BLACK, 1.0)


def square(centre: tuple[float, float, float], half: float, color: tuple[float, float, float]) -> Shape:
    """A square facing +z, not lit."""
    corner = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half + np.array(centre)
    positions = corner[[[0, 1, 2], [0, 2, 3]]]
    normals = np.broadcast_to(np.array([0.0, 0.0, 1.0]), positions.shape)
    uv = positions[..., :2] / (2 * half) + 0.5
    return Shape(positions, normals, uv, np.tile(np.array(color, np.float32), (2, 1)), lit=False)


def join(*shapes: Shape) -> Shape:
    parts = [np.concatenate([getattr(shape, name) for shape in shapes]) for name in ("positions", "normals", "uv")]
    return Shape(*parts, colors=np.concatenate([shape.colors for shape in shapes]), lit=False)


def test_three_quarter_axes_are_right_handed_and_orthonormal() -> None:
    axes = three_quarter_axes()
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-12)
    assert axes[1, 1] > 0.9


def test_the_camera_fits_all_points_and_touches_the_margin() -> None:
    points = np.random.default_rng(0).normal(size=(100, 3)) * [1, 5, 2] + [100, 0, -3]
    camera = Camera.fit(points, three_quarter_axes())
    clip = points @ camera.matrix()[:3, :3] + camera.matrix()[3, :3]
    assert np.isclose(np.abs(clip[:, :2]).max(), MARGIN, atol=1e-4)
    assert np.abs(clip[:, 2]).max() + LIFT < 1.0


def test_the_nearer_square_hides_the_farther_one(context: moderngl.Context) -> None:
    near, far = square((0, 0, 1), 0.5, (1, 0, 0)), square((0, 0, -1), 1.0, (0, 0, 1))
    camera = Camera.fit(np.array([[-1.0, -1, -1], [1, 1, 1]]), np.eye(3))
    for scene in (join(near, far), join(far, near)):
        picture = draw(context, camera, scene, NO_LINES, pixels=64, paper=WHITE)
        np.testing.assert_allclose(picture[32, 32], [1, 0, 0], atol=1e-3)
        np.testing.assert_allclose(picture[32, 8], [0, 0, 1], atol=1e-3)
        np.testing.assert_allclose(picture[0, 0], WHITE, atol=1e-3)


def test_y_is_up_and_x_is_right(context: moderngl.Context) -> None:
    scene = square((0.5, 0.5, 0), 0.25, (0, 1, 0))
    camera = Camera.fit(np.array([[-1.0, -1, -1], [1, 1, 1]]), np.eye(3))
    picture = draw(context, camera, scene, NO_LINES, pixels=64, paper=BLACK)
    row, column = np.argwhere(picture[..., 1] > 0.5).mean(axis=0)
    assert row < 24
    assert column > 40


def test_a_square_covers_its_area(context: moderngl.Context) -> None:
    camera = Camera.fit(np.array([[-1.0, -1, -1], [1, 1, 1]]), np.eye(3))
    picture = draw(context, camera, square((0, 0, 0), 0.613, WHITE), NO_LINES, pixels=64, paper=BLACK)
    assert abs(picture[..., 0].mean() - (0.613 * MARGIN) ** 2) < 0.005


def test_lines_lie_on_the_surface_and_have_their_width(context: moderngl.Context) -> None:
    lines = Lines(np.array([[[-1.0, 0, 0], [1.0, 0, 0]]]), BLACK, 4.0)
    camera = Camera.fit(np.array([[-1.0, -1, -1], [1, 1, 1]]), np.eye(3))
    picture = draw(context, camera, square((0, 0, 0), 1.0, WHITE), lines, pixels=64, paper=WHITE)
    assert abs((1 - picture[:, 32, 0]).sum() - 4.0) < 0.2


def test_the_checker_alternates_along_uv(context: moderngl.Context) -> None:
    plain = square((0, 0, 0), 1.0, (0.5, 0.5, 0.5))
    shape = Shape(plain.positions, plain.normals, plain.uv, plain.colors, cells=2.0, lit=False)
    camera = Camera.fit(np.array([[-1.0, -1, -1], [1, 1, 1]]), np.eye(3))
    picture = draw(context, camera, shape, NO_LINES, pixels=64, paper=BLACK)[..., 0]
    assert picture[16, 16] == picture[48, 48] < 0.3  # top left and bottom right are the odd cells
    assert picture[16, 48] == picture[48, 16] > 0.7


def test_a_lit_sheet_is_as_bright_from_behind(context: moderngl.Context) -> None:
    plain = square((0, 0, 0), 1.0, (0.5, 0.5, 0.5))
    camera = Camera.fit(np.array([[-1.0, -1, -1], [1, 1, 1]]), np.eye(3))
    pictures = []
    for normals in (plain.normals, -plain.normals):
        shape = Shape(plain.positions, normals, plain.uv, plain.colors)
        pictures.append(draw(context, camera, shape, NO_LINES, pixels=16, paper=BLACK))
    np.testing.assert_array_equal(pictures[0], pictures[1])
    assert pictures[0].max() > 0.2
