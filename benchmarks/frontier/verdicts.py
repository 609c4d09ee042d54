"""What the rows of one mesh say: by which setting each peer is beaten, and where more charts came out worse."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

Row = dict[str, Any]

COUNTS = {"one chart": 1, "charts 2": 2, "charts 4": 4, "default": 8, "charts 16": 16, "charts 32": 32}
"""Settings that differ in the most charts alone, and their number."""


def beaten_by(rows: list[Row], peer: str, peers: tuple[str, ...]) -> list[str]:
    """Settings of ours with a shorter seam than a peer's and no more distortion, in the order of the rows."""
    theirs = next((row for row in rows if row["tool"] == peer and not row["said"]), None)
    if theirs is None:
        return []
    ours = [row for row in rows if row["tool"] not in peers and not row["said"]]
    better = [row for row in ours if row["seam"] < theirs["seam"] and row["stretch"] <= theirs["stretch"]]
    return [row["tool"] for row in better]


def rises(rows: list[Row], slack: float = 5e-6) -> list[tuple[int, int, float]]:
    """(fewer, more, by how much) where the objective rises from one limit on charts to the next that was run."""
    found = {COUNTS[row["tool"]]: float(row["objective"]) for row in rows if row["tool"] in COUNTS and not row["said"]}
    limits = sorted(found)
    steps = [(few, more, found[more] - found[few]) for few, more in pairwise(limits)]
    return [step for step in steps if step[2] > slack]


def sentences(mesh: str, rows: list[Row], peers: tuple[str, ...]) -> list[str]:
    """A sentence for each peer that was run, and one on the limits of charts."""
    said = []
    for peer in peers:
        if any(row["tool"] == peer and not row["said"] for row in rows):
            better = beaten_by(rows, peer, peers)
            by = f"a shorter seam at no more distortion by {', '.join(better)}" if better else "beaten by no setting"
            said.append(f"- {mesh}, {peer}: {by}")
    counted = sum(row["tool"] in COUNTS and not row["said"] for row in rows)
    if counted > 1:
        worse = [f"{more} charts cost {by:.4f} more than {few}" for few, more, by in rises(rows)]
        said.append(f"- {mesh}, {counted} limits on charts: {'; '.join(worse) or 'more charts never cost more'}")
    return said
