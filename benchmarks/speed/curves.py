"""Time or memory over faces as SVG, both on logarithmic axes: a line for each tool and family, and a slope of one."""

from __future__ import annotations

from typing import Any

from benchmarks.frontier.plot import COLORS, OURS, Axis, stroke, text

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720.0, 460.0, 64.0, 170.0, 40.0, 56.0
DASHES = {"scan": "", "gyroid": "6 3", "bunny": "2 3", "cloud": "8 3 2 3"}
"""How a family's line is drawn; the shared models are one with the bunny subdivided, where it is among them."""


def drawn(title: str, rows: list[dict[str, Any]], key: str) -> str:
    """The plot of rows with tool, family, faces and ``key``."""
    x = Axis([row["faces"] for row in rows], LEFT, WIDTH - RIGHT)
    y = Axis([row[key] for row in rows], HEIGHT - BOTTOM, TOP)
    parts = [text(WIDTH / 2, 22.0, title, "middle", 15)]
    for value in x.ticks():
        parts.append(stroke(x.at(value), HEIGHT - BOTTOM, x.at(value), TOP))
        if f"{value:.0e}".startswith("1"):
            parts.append(text(x.at(value), HEIGHT - BOTTOM + 18.0, f"{value:,.0f}", "middle"))
    for value in y.ticks():
        parts.append(stroke(LEFT, y.at(value), WIDTH - RIGHT, y.at(value)))
        parts.append(text(LEFT - 8.0, y.at(value) + 4.0, f"{value:g}", "end"))
    parts.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14.0, "faces", "middle"))
    shown = 0
    for tool in dict.fromkeys(row["tool"] for row in rows):
        for family, dash in DASHES.items():
            line = sorted((row["faces"], row[key]) for row in rows if belongs(row, tool, family))
            if line:
                style = f'stroke="{COLORS.get(tool, OURS)}" stroke-width="1.6" stroke-dasharray="{dash or "none"}"'
                parts += curve([(x.at(faces), y.at(value)) for faces, value in line], style)
                parts += named(f"{tool}, {family}", TOP + 20.0 * shown, style)
                shown += 1
    size = f'width="{WIDTH:g}" height="{HEIGHT:g}" viewBox="0 0 {WIDTH:g} {HEIGHT:g}"'
    style = 'font-family="sans-serif" style="background:#fff"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>\n' + "\n".join(parts) + "\n</svg>\n"


def belongs(row: dict[str, Any], tool: str, family: str) -> bool:
    """Whether a row lies on the line of a tool and family."""
    return row["tool"] == tool and (row["family"] == family or (family == "bunny" and row["name"] == "bunny"))


def curve(points: list[tuple[float, float]], style: str) -> list[str]:
    """A line through points in pixels, and dots on it."""
    through = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" {style}/>' for x, y in points]
    return [f'<polyline points="{through}" fill="none" {style}/>', *dots]


def named(words: str, height: float, style: str) -> list[str]:
    """A line of the legend."""
    left = WIDTH - RIGHT + 14.0
    sample = f'<line x1="{left:.1f}" y1="{height:.1f}" x2="{left + 30.0:.1f}" y2="{height:.1f}" {style}/>'
    return [sample, text(left + 36.0, height + 4.0, words, "start")]
