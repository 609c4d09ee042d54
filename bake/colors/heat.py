"""Distortion as colour: the scale that the preview and the map `distortion` share.

f faces.  Red faces are larger in uv than their share of the surface, blue ones smaller; how deep the colour is says
how distorted the face is, whatever the kind of distortion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.triangles import signed_areas, triangle_areas
from .color import linear_from_oklab

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas

SCALES = (1.02, 1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0)
"""Upper ends of the distortion scale; the first that holds 98 % of the faces is taken."""
HEAT = np.array([[0.42, -0.03, -0.17], [0.68, -0.05, -0.10], [0.95, 0, 0], [0.70, 0.11, 0.06], [0.46, 0.17, 0.08]])
"""Oklab colours at −1, −½, 0, ½, 1 of the distortion scale."""


def distortion_scale(face_distortion: NDArray[np.float64]) -> float:
    """Upper end of the colour scale: the first of `SCALES` that 98 % of the faces do not exceed."""
    reach = float(np.quantile(np.minimum(face_distortion, SCALES[-1]), 0.98))
    return next((scale for scale in SCALES if scale >= reach), SCALES[-1])


def signed_distortion(atlas: Atlas, face_distortion: NDArray[np.float64], top: float) -> NDArray[np.float64]:
    """(f,) in [−1, 1]: 0 = isometric, ±1 = distortion `top` or more; negative where uv is smaller than its share."""
    surface, flat = face_areas(atlas)
    sign = np.where(flat * surface.sum() < surface * flat.sum(), -1.0, 1.0)
    excess = np.nan_to_num(face_distortion, nan=top, posinf=top) - 1.0
    return sign * np.clip(excess / (top - 1.0), 0.0, 1.0)


def heat_colors(value: NDArray[np.float64]) -> NDArray[np.float32]:
    """(m,) in [−1, 1] → (m, 3) float32 linear light: blue, near white, red, even steps in Oklab."""
    lab = np.stack([np.interp(value, (-1.0, -0.5, 0.0, 0.5, 1.0), channel) for channel in HEAT.T], axis=-1)
    return np.clip(linear_from_oklab(lab), 0.0, 1.0).astype(np.float32)


def face_areas(atlas: Atlas) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Area of each face on the surface and in uv, (f,) float64 each, not negative."""
    return triangle_areas(atlas.positions[atlas.faces]), np.abs(signed_areas(atlas.even_uv))
