"""The proof that an exported graph equals its model: both run on the same points, and every output is compared.

n points · p patches · Δ difference.  uv in [0, 1]², score in [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import onnxruntime
from onnxruntime.capi.onnxruntime_pybind11_state import Fail, InvalidArgument, InvalidGraph, RuntimeException
from onnxruntime.capi.onnxruntime_pybind11_state import NotImplemented as OrtNotImplemented

from ...runtime.errors import ParityError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas, Frame


@dataclass(frozen=True)
class ParitySpec:
    """Where model and onnxruntime are compared, and how closely they must agree."""

    sizes: tuple[int, ...] = (1, 2, 1000)
    """Numbers of points n; 1 finds a frozen axis, 2 a squeezed one."""
    uv_atol: float = 1e-4
    """Largest |Δuv|: 0.04 texels at 2048², a tenth of what the networks themselves miss the atlas by at most."""
    score_atol: float = 1e-4
    """Largest |Δscore|."""
    tie: float = 1e-4
    """Two logits closer than this × (1 + max |logit|) are a tie: either patch may win, and the point is left out."""
    least: float = 0.25
    """Least share of the points that has to be no tie: fewer prove nothing."""
    seed: int = 0
    """Seed of the probe points."""


NEAR = 0.01
"""How far probes near the surface lie from it along each axis at most, as a share of the frame's radius."""


class Truth(NamedTuple):
    """What a model says at n points.

    uv (n, 2) float32, chart (n,) int64, score (n,) float32: what the file has to say.  patch (n,): which network
    answered.  clear (n,) bool: False where two are so close that rounding decides.
    """

    uv: NDArray[np.float32]
    chart: NDArray[np.int64]
    score: NDArray[np.float32]
    patch: NDArray[np.int64]
    clear: NDArray[np.bool_]


@dataclass(frozen=True)
class ParityReport:
    """What the proof found.

    compared, ties: points of all sizes together, and those left out.  patches: how many of the p patches answered at
    least once.  uv_error, score_error: max |Δ|.
    """

    sizes: tuple[int, ...]
    compared: int
    ties: int
    patches: int
    uv_error: float
    score_error: float


def probe_points(
    atlas: Atlas, frame: Frame, face_patch: NDArray[np.int64], count: int, seed: int
) -> NDArray[np.float32]:
    """(count, 3) float32, source units: half on the surface, a quarter near it, a quarter in the frame's ball.

    Those on the surface visit the patches that have faces in turn, each face of a patch being as likely as the next.
    Those near it are for surfaces that lie in the very planes that part two patches, as walls that touch do: there all
    are ties.
    """
    rng = np.random.default_rng(seed)
    by_patch = np.argsort(face_patch, kind="stable")
    _, first, faces = np.unique(face_patch[by_patch], return_index=True, return_counts=True)
    turn = np.arange(count) % len(faces)
    face = by_patch[first[turn] + rng.integers(faces[turn])]
    weight = rng.dirichlet(np.ones(3), size=count)
    points = np.einsum("nc,ncx->nx", weight, atlas.positions[atlas.faces[face]])
    direction = rng.normal(size=(count, 3))
    radius = np.cbrt(rng.random((count, 1))) * frame.scale / np.linalg.norm(direction, axis=1, keepdims=True)
    order = rng.permutation(count)
    near, anywhere = (order >= count // 4) & (order < count // 2), order < count // 4
    points[near] += rng.uniform(-NEAR, NEAR, size=(count, 3))[near] * frame.scale
    points[anywhere] = (np.asarray(frame.centre) + direction * radius)[anywhere]
    return points.astype(np.float32)


def prove_parity(
    model: Callable[[NDArray[np.float32]], Truth], content: bytes, points: NDArray[np.float32], spec: ParitySpec
) -> ParityReport:
    """Compare a model with its ONNX file's ``content`` at the first n of ``points``, n in spec.sizes.

    Raises:
        ParityError: names the output, n, max |Δ| and what was allowed; or most points are ties and prove nothing.
    """
    session = load_model(content)
    compared = ties = 0
    uv_error = score_error = 0.0
    answered: set[int] = set()
    for n in spec.sizes:
        sample = points[:n]
        uv, chart, score = run_model(session, ("uv", "chart", "score"), {"points": sample})
        truth = model(sample)
        clear = truth.clear
        uv_error = max(uv_error, largest_difference("uv", uv, truth.uv, clear, n, spec.uv_atol))
        largest_difference("chart", chart, truth.chart, clear, n, 0.0)
        score_error = max(score_error, largest_difference("score", score, truth.score, clear, n, spec.score_atol))
        answered.update(truth.patch[clear].tolist())
        compared, ties = compared + int(clear.sum()), ties + int((~clear).sum())
    if compared < spec.least * (compared + ties):
        found = f"{ties} of {compared + ties} probe points are ties between patches"
        raise ParityError(f"{found}, expected at most {1.0 - spec.least:.0%}; train the networks")
    return ParityReport(tuple(spec.sizes), compared, ties, len(answered), uv_error, score_error)


def load_model(content: bytes) -> onnxruntime.InferenceSession:
    """The model on one CPU provider.  Raises: ParityError when onnxruntime refuses it."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except (Fail, InvalidArgument, InvalidGraph, OrtNotImplemented, RuntimeException) as error:
        reason = str(error).splitlines()[0]
        raise ParityError(f"onnxruntime can't load the graph ({reason}), expected a valid model; report it") from error


def run_model(
    session: onnxruntime.InferenceSession, outputs: Sequence[str], feed: Mapping[str, NDArray[Any]]
) -> list[NDArray[np.generic]]:
    """The outputs named.  Raises: ParityError when onnxruntime can't compute them."""
    try:
        found = session.run(list(outputs), dict(feed))
    except (Fail, InvalidArgument, RuntimeException) as error:
        reason = str(error).splitlines()[0]
        message = f"onnxruntime can't run the graph at n = {len(next(iter(feed.values())))} ({reason})"
        raise ParityError(f"{message}, expected it to run; report this model, nothing was written") from error
    return [np.asarray(output) for output in found]


def largest_difference(
    name: str, found: NDArray[np.generic], truth: NDArray[np.generic], clear: NDArray[np.bool_], n: int, atol: float
) -> float:
    """Largest |Δ| over the points without a tie."""
    remedy = "report this model, nothing was written"
    if found.shape != truth.shape or found.dtype != truth.dtype:
        shapes = f"{found.shape} {found.dtype} from onnxruntime, {truth.shape} {truth.dtype} from the model"
        raise ParityError(f"{name} at n = {n}: {shapes}, expected the same; {remedy}")
    delta = np.abs(found[clear].astype(np.float64) - truth[clear].astype(np.float64))
    error = float(delta.max(initial=0.0))
    if not error <= atol:
        raise ParityError(f"{name} at n = {n}: max |Δ| = {error:.3g}, expected at most {atol:.3g}; {remedy}")
    return error
