# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be asked of an unwrap: the same for the command, which keeps what it was run with, and for the sidebar."""

from __future__ import annotations

from typing import Any

import bpy


class UnwrapSettings:
    """Properties; Blender takes them over from this class into those that inherit it."""

    charts: bpy.props.IntProperty(
        name="Charts", default=8, min=1, max=1000, description="The most charts of each connected part"
    )
    max_stretch: bpy.props.FloatProperty(
        name="Max Stretch",
        default=0.0,
        min=0.0,
        max=2.0,
        precision=3,
        description="Mean stretch a part may have, 1 is none, for the shortest seams that keep it; 0: both are weighed",
    )
    time_budget: bpy.props.FloatProperty(
        name="Seconds", default=0.0, min=0.0, description="Time for the search of charts; 0 is no limit"
    )
    size: bpy.props.IntProperty(name="Size", default=2048, min=16, max=16384, description="Texels of the atlas' side")
    padding: bpy.props.IntProperty(name="Padding", default=8, min=0, description="Free texels around each chart")
    seed: bpy.props.IntProperty(name="Seed", default=0, min=0)
    selected_only: bpy.props.BoolProperty(
        name="Selected Faces", default=False, description="In edit mode, the selected faces only"
    )
    keep_seams: bpy.props.BoolProperty(
        name="Keep Seams", default=False, description="Edges marked as seams before stay seams; new ones are added"
    )
    seams: bpy.props.EnumProperty(
        name="Seams",
        items=[
            ("short", "Short", "Anywhere, as short as pays"),
            ("hidden", "Hidden", "Where the surface sees less of the sky, though they are longer for it"),
            ("crease", "Creases", "Along creases, though they are longer for it"),
        ],
    )
    protect: bpy.props.StringProperty(
        name="Protect", description="Vertex group whose faces seams keep away from, at ten times the price"
    )
    mark_seams: bpy.props.BoolProperty(name="Mark Seams", default=True, description="Seams become Blender's seams")


NAMES = tuple(UnwrapSettings.__annotations__)


class FlexparaSettings(UnwrapSettings, bpy.types.PropertyGroup):
    """What the sidebar shows, kept with the scene."""


def settings_of(context: Any) -> Any:
    """Those of a scene."""
    return context.scene.flexpara_settings


def handed_over(settings: Any, command: Any) -> None:
    """Give a command, about to be run, what the sidebar shows of what it takes."""
    for name in NAMES:
        if hasattr(command, name):
            setattr(command, name, getattr(settings, name))


def add() -> None:
    """Every scene has them."""
    bpy.types.Scene.flexpara_settings = bpy.props.PointerProperty(type=FlexparaSettings)


def remove() -> None:
    """No scene has them."""
    del bpy.types.Scene.flexpara_settings


CLASSES = (FlexparaSettings,)
