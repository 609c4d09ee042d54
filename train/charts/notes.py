"""What a user may not expect of the charts that were found, a sentence each."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ...runtime.process.deadline import Deadline, Late
    from ..config import FinishConfig
    from .charts import Solved


def hurried(deadline: Deadline, late: Late) -> Iterator[str]:
    """What a user has to know of a search that a deadline ended."""
    if late():
        budget = "on request" if deadline.asked else f"by the time budget of {deadline.seconds:g} s"
        yield f"the search was ended {budget}; with more time the charts may be fewer and less stretched"


def notes(solved: dict[int, Solved], charts: int, config: FinishConfig) -> tuple[str, ...]:
    """What a user may not expect of the parts' charts, a sentence each."""
    found = []
    holed = [len(part.pieces) for part in solved.values() if len(part.pieces) > charts and part.way == "unfolded"]
    if holed:
        found.append(
            f"{len(holed)} of {len(solved)} different parts got more than {charts} charts (up to {max(holed)}): they "
            "are laid out without stretch, and the side of each hole is a chart"
        )
    many = [len(part.pieces) for part in solved.values() if len(part.pieces) > charts and part.way != "unfolded"]
    if many:
        found.append(
            f"{len(many)} of {len(solved)} different parts got more than {charts} charts (up to {max(many)}), since "
            f"fewer would stretch them by more than {1.0 + config.most_excess:g} on the mean"
        )
    stretched = [sum(piece.energy for piece in part.pieces) for part in solved.values()]
    asked = config.stretch or config.most_excess
    missed = sum(excess > asked for excess in stretched)
    if config.stretch and missed:
        found.append(
            f"{missed} of {len(solved)} different parts keep a mean stretch of up to {1.0 + max(stretched):.4g}, above "
            f"the {1.0 + config.stretch:g} asked for: it is the closest that was found; allow more --charts"
        )
    elif missed:
        found.append(
            f"{missed} of {len(solved)} different parts keep a mean "
            f"stretch of up to {1.0 + max(stretched):.3g}; a smaller --charts does not help, a cleaner mesh may"
        )
    resorts = Counter(piece.resort for part in solved.values() for piece in part.pieces)
    if resorts["projection"]:
        found.append(f"{resorts['projection']} charts are projections, since there was no time to lay them out")
    if resort := resorts["xatlas"]:
        found.append(f"{resort} charts were flattened by xatlas, where our own flattening found nothing valid")
    return tuple(found)


def kept_isometric(charts: int, config: FinishConfig, *, late: bool = False) -> Iterator[str]:
    """What a user has to know of charts that the energy asked for would lay over themselves, or had no time for."""
    if late and config.energy.kind != "isometric":
        yield f"no time was left for energy {config.energy.kind}: all charts are isometric"
    if charts:
        yield f"{charts} charts would lie over themselves by energy {config.energy.kind}: they are isometric"


def mirror_facts(solved: dict[int, Solved], config: FinishConfig) -> Iterator[str]:
    """What became of mirrored charts, where they are asked for."""
    axis = config.symmetry.axis
    if axis == "none":
        return
    planes = [part for part in solved.values() if part.unlike is not None]
    if len(planes) < len(solved):
        across = "x, y or z" if axis == "auto" else axis
        yield f"{len(solved) - len(planes)} of {len(solved)} different parts are no mirror image across {across}"
    unlike = sum(part.unlike or 0 for part in planes)
    if unlike:
        yield f"{unlike} faces have no mirror image: seams beside them are as like as the triangles allow"
    if worse := sum(part.way != "mirrored" for part in planes):
        yield f"{worse} parts have a mirror plane, but charts that are no mirror images cost less"
