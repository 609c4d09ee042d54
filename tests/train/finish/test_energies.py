"""Charts finished by another energy: each lowers its own, at the price of the other; what would overlap stays."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.train.finish.config import EnergyConfig
from flexpara.train.finish.energies import KINDS, finished_by
from flexpara.train.finish.flatten import flatten, jacobians
from flexpara.train.finish.pieces import Piece, measured
from flexpara.train.finish.slits import Flat


def bowl(count: int = 12) -> Surface:
    """A square grid bent onto a paraboloid: no layout of it is both true to angles and to areas."""
    x, y = (axis.reshape(-1) for axis in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, count)], indexing="ij"))
    corner = np.arange(count * count).reshape(count, count)
    a, b, c, d = (part.reshape(-1) for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(np.stack([x, y, 0.7 * (x**2 + y**2)], axis=1), faces)


def chart(surface: Surface) -> Piece:
    flat = Flat(surface, flatten(surface, 20), {})
    return measured(surface, np.arange(len(surface.faces)), flat, float(surface.face_areas().sum()))


def energies(piece: Piece) -> dict[str, float]:
    """Area-weighted means of what each kind lowers."""
    surface = piece.flat.surface
    first, second = np.linalg.svd(jacobians(surface, piece.flat.uv), compute_uv=False).T
    area = surface.face_areas() / surface.face_areas().sum()
    return {
        "isometric": float(area @ (first**2 + second**2 + first**-2.0 + second**-2.0)),
        "conformal": float(area @ ((first**2 + second**2) / (2.0 * first * second))),
        "arap": float(area @ ((first - 1.0) ** 2 + (second - 1.0) ** 2)),
    }


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_each_energy_is_lowered_by_its_own_finishing_alone(kind: str) -> None:
    plain = chart(bowl())
    (found,), left = finished_by([plain], plain.flat.surface.face_areas().sum(), EnergyConfig(kind))
    before, after = energies(plain), energies(found)
    assert left == 0
    assert after[kind] < before[kind]
    assert after["isometric"] > before["isometric"]
    assert found.energy == pytest.approx(after["isometric"] / 4.0 - 1.0, rel=1e-9)


def test_conformal_charts_of_a_bowl_have_true_angles_and_the_area_of_their_surface() -> None:
    plain = chart(bowl())
    (found,), _ = finished_by([plain], plain.flat.surface.face_areas().sum(), EnergyConfig("conformal"))
    assert energies(found)["conformal"] < 1.0 + 0.3 * (energies(plain)["conformal"] - 1.0)
    determinant = np.linalg.det(jacobians(found.flat.surface, found.flat.uv))
    area = found.flat.surface.face_areas()
    assert float(area @ determinant) == pytest.approx(float(area.sum()), rel=1e-9)


def test_the_search_s_own_energy_leaves_charts_as_they_are_and_what_overlaps_stays() -> None:
    plain = chart(bowl())
    assert finished_by([plain], 1.0, EnergyConfig())[0][0] is plain
    none = EnergyConfig("conformal", steps=())  # as if no number of steps were valid
    assert finished_by([plain], 1.0, none) == ([plain], 1)
