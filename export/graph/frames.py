"""The frame in an exported graph: source units ⇄ unit ball in float32, without loss far from the origin."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.sessions.bundle import BundleMetadata
    from .builder import GraphBuilder


class FoldedFrame(NamedTuple):
    """A frame in float32 without loss: xyz = ((points − centre) − centre_rest) / scale.

    Near a far-away centre, points − centre is exact in float32; centre_rest is what rounding the centre lost.
    centre, centre_rest: (3,) float32.  scale: () float32.
    """

    centre: NDArray[np.float32]
    centre_rest: NDArray[np.float32]
    scale: NDArray[np.float32]


def fold_frame(metadata: BundleMetadata) -> FoldedFrame:
    """The frame of the metadata, split into float32 parts."""
    exact = np.asarray(metadata.frame.centre, dtype=np.float64)
    centre = exact.astype(np.float32)
    rest = (exact - centre.astype(np.float64)).astype(np.float32)
    return FoldedFrame(centre, rest, np.asarray(metadata.frame.scale, dtype=np.float32))


def unit_ball(builder: GraphBuilder, metadata: BundleMetadata) -> str:
    """Nodes from `points` to the unit ball, (n, 3).

    The session zeroes the initializers centre and centre_rest: it subtracts the frame's centre in float64.
    """
    folded = fold_frame(metadata)
    near = builder.op("Sub", "points", builder.named("centre", folded.centre))
    exact = builder.op("Sub", near, builder.named("centre_rest", folded.centre_rest))
    return builder.op("Div", exact, builder.named("scale", folded.scale), name="xyz")
