"""A plot of seam length over distortion, as SVG: both on logarithmic axes, lower left is better."""

from __future__ import annotations

from html import escape
from math import floor, log10
from typing import Any

WIDTH, HEIGHT, MARGIN = 640.0, 420.0, 64.0
COLORS = {"xatlas": "#b3541e", "uvunwrap": "#7a3e9d"}
OURS = "#1f6f8b"
SMALLEST = 1e-5, 0.05
"""Excess stretch and seam below which a point lies on the axis."""


def drawn(title: str, rows: list[dict[str, Any]]) -> str:
    """The plot of rows with tool, stretch and seam as the text of an SVG file."""
    points = [
        (row["tool"], max(row["stretch"] - 1.0, SMALLEST[0]), max(row["seam"], SMALLEST[1]), row["charts"])
        for row in rows
    ]
    x, y = Axis([p[1] for p in points], MARGIN, WIDTH - 150.0), Axis([p[2] for p in points], HEIGHT - MARGIN, 40.0)
    parts = [text(WIDTH / 2, 22.0, title, "middle", 15)]
    parts += [text(x.at(value), HEIGHT - MARGIN + 18.0, f"{value:g}", "middle") for value in x.ticks()]
    parts += [text(MARGIN - 8.0, y.at(value) + 4.0, f"{value:g}", "end") for value in y.ticks()]
    parts += [stroke(x.at(value), HEIGHT - MARGIN, x.at(value), 40.0) for value in x.ticks()]
    parts += [stroke(MARGIN, y.at(value), WIDTH - 150.0, y.at(value)) for value in y.ticks()]
    parts.append(text((MARGIN + WIDTH - 150.0) / 2, HEIGHT - 14.0, "mean symmetric Dirichlet − 1", "middle"))
    parts.append(text(14.0, 34.0, "seam length / √area", "start"))
    for tool, stretch, seam, charts in points:
        color = COLORS.get(tool, OURS)
        parts.append(f'<circle cx="{x.at(stretch):.1f}" cy="{y.at(seam):.1f}" r="4.5" fill="{color}"/>')
        parts.append(text(x.at(stretch) + 8.0, y.at(seam) + 4.0, f"{tool} ({charts})", "start", color=color))
    size = f'width="{WIDTH:g}" height="{HEIGHT:g}" viewBox="0 0 {WIDTH:g} {HEIGHT:g}"'
    style = 'font-family="sans-serif" style="background:#fff"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>\n' + "\n".join(parts) + "\n</svg>\n"


class Axis:
    """A logarithmic axis from one pixel to another."""

    def __init__(self, values: list[float], first: float, last: float) -> None:
        self.low = log10(min(values, default=0.1)) - 0.1
        self.high = log10(max(values, default=1.0)) + 0.1
        self.first, self.last = first, last

    def at(self, value: float) -> float:
        """The pixel of a value."""
        return self.first + (log10(value) - self.low) / (self.high - self.low) * (self.last - self.first)

    def ticks(self) -> list[float]:
        """1, 2 and 5 times powers of ten within reach."""
        powers = range(floor(self.low), floor(self.high) + 1)
        found = [step * 10.0**power for power in powers for step in (1, 2, 5)]
        return [value for value in found if self.low <= log10(value) <= self.high]


def text(x: float, y: float, words: str, anchor: str, size: int = 12, color: str = "#222") -> str:
    """Words at a place."""
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" fill="{color}"'
    return f"<text {place}>{escape(words)}</text>"


def stroke(x1: float, y1: float, x2: float, y2: float) -> str:
    """A thin line."""
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#ddd"/>'
