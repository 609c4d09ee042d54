"""What reading and cleaning could not take as it was, in words: a line each for the user.

Counts that tell a reader of the report something, but change nothing that the user would miss, stay unsaid: vertices
that were welded or that no face uses, how many parts there are, and primitives without a material, which get glTF's own
default by name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...material import READ_BY, used_materials
from ...options.unwrap import POLYGONS, SCENES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ...mesh import Asset
    from ...options.unwrap import Outputs

TREES = ("usda",)
"""Formats beside glTF that hold a tree of named meshes."""
MATERIALS = ("glb", "gltf", "obj", "usda")
"""Formats that hold several materials."""
UNSAID = frozenset({"welded_vertices", "unreferenced_vertices", "components", "given_materials"})
WORDS = {
    "coincident_faces": "{} lying on another kept, each side with uv of its own|face|faces",
    "degenerate_faces": "{} without area left out|face|faces",
    "draco_undone": "Draco's compression of {} undone; compress the result again|primitive|primitives",
    "dropped_face_colors": "colours of {} left out, as the vertices have their own|face|faces",
    "dropped_normals": "normals of {} left out, as other parts have none|vertex|vertices",
    "faces_under_three_corners": "{} of under three corners left out|face|faces",
    "faces_without_colors": "{} without colours made white|face|faces",
    "faces_without_uv": "{} without uv in a mesh that has them|face|faces",
    "flipped_faces": "{} turned to agree with the others around|face|faces",
    "flat_islands": "{} without area in uv left in one point|island|islands",
    "joined_materials": "{} joined into one|material|materials",
    "joined_nodes": "{} of the scene joined into one mesh|node|nodes",
    "invalid_islands": "{} with triangles that overlap or are turned over, as in the file|island|islands",
    "joined_solids": "{} joined into one mesh|solid|solids",
    "kept_axes": "the z axis, which {} calls up, stays z; glTF takes y for up|file|files",
    "meshopt_undone": "meshopt's compression of {} undone; compress the result again|piece|pieces",
    "missing_materials": "{} of materials not found beside the mesh|file|files",
    "missing_textures": "{} not found or in a format that is not read|texture|textures",
    "missing_uv_or_normals": "{} referring to uv or normals that the file does not hold|corner|corners",
    "non_manifold_edges": "{} with three faces or more, cut there|edge|edges",
    "points_without_normal": "{} without a normal in a cloud that has them|point|points",
    "polygons_as_triangles": "{} of over three corners written as triangles|polygon|polygons",
    "polygons_cut": "{} cut by seams or covered by no fan, written as triangles|polygon|polygons",
    "repaired_normals": "{} of no length or not finite replaced|normal|normals",
    "skipped_animations": "{} left out|animation|animations",
    "skipped_attributes": "{} of vertices left out, which only glTF holds|attribute|attributes",
    "skipped_cameras": "{} left out|camera|cameras",
    "skipped_curves": "{} left out|curve or free-form surface|curves or free-form surfaces",
    "skipped_elements": "{} of other kinds than vertex and face left out|table|tables",
    "skipped_extensions": "{} of glTF left out|extension|extensions",
    "skipped_extras": "extras of {} left out|object|objects",
    "skipped_facet_values": "attributes of {} left out|facet|facets",
    "skipped_lights": "{} left out|light|lights",
    "skipped_lines": "{} left out|line element|line elements",
    "skipped_meshes": "{} not selected or without triangles left out|mesh|meshes",
    "skipped_morph_targets": "{} left out|morph target|morph targets",
    "skipped_names": "{} of objects, groups or smoothing left out|name|names",
    "skipped_pictures": "{} of materials left out, as they lie on the old uv|picture|pictures",
    "skipped_points": "{} left out|point element|point elements",
    "skipped_primitives": "{} of points or lines left out|primitive|primitives",
    "skipped_properties": "{} of vertices or faces left out, which no output holds|property|properties",
    "skipped_skins": "{} left out: the mesh stands as it was modelled|skin|skins",
    "skipped_splat_shapes": "scales, turns and view-dependent colours of {} left out|splat|splats",
    "skipped_uv_sets": "{} beside the first left out|uv set|uv sets",
    "textures_not_decoded": "{} in a format that is not decoded, not baked|texture|textures",
    "textures_of_other_uv": "{} on a second uv set not baked|texture|textures",
    "textures_to_8_bits": "{} of 16 bits a channel read as 8|texture|textures",
    "trailing_bytes": "{} behind the last triangle left out|byte|bytes",
    "unreadable_materials": "materials of {} not found in the file, or damaged, left out|mesh|meshes",
    "uv_not_finite": "uv of {} not finite, set to 0|vertex|vertices",
    "vertices_without_colors": "{} without colours made white|vertex|vertices",
    "vertices_without_z": "{} of two numbers placed at z = 0|vertex|vertices",
}


def lost(asset: Asset, outputs: Outputs) -> dict[str, int]:
    """What is in the file of a mesh and in nothing that will be written, name → count.

    outputs: without "auto".
    """
    written, counts = set(outputs.formats), dict[str, int]()
    whole = not written.isdisjoint(SCENES)
    if asset.document is not None and not whole:
        counts |= asset.document.beyond_meshes()
        counts |= asset.document.joined() if written.isdisjoint(TREES) else {}
    if asset.document is not None and whole:
        counts |= asset.document.compressed()
    if asset.document is not None and whole and outputs.uv_set is None:
        counts["given_materials"] = asset.document.without_material()
    if asset.obj is not None and "obj" not in written:
        counts |= asset.obj.beyond_meshes(objects=written.isdisjoint(TREES))
    if asset.obj is not None and "obj" in written:
        counts["skipped_pictures"] = asset.obj.pictures(outputs.maps)
    elif not whole:
        counts["skipped_pictures"] = _pictures(asset, outputs.maps)
    if asset.polygons is not None and written.isdisjoint(POLYGONS):
        counts["polygons_as_triangles"] = asset.polygons.large
    materials = len(used_materials(asset))
    if materials > 1 and written.isdisjoint(MATERIALS):
        counts["joined_materials"] = materials
    return {name: count for name, count in counts.items() if count}


def _pictures(asset: Asset, maps: Sequence[str]) -> int:
    """How many pictures its materials have that none of the maps baked is made of."""
    baked = {slot for slot, names in READ_BY.items() if not set(names).isdisjoint(maps)}
    pictures = [each for entry in used_materials(asset) for each in entry.pictures.items()]
    return len({id(picture.pixels) for slot, picture in pictures if slot not in baked})


def told(changes: Mapping[str, int]) -> list[str]:
    """A line without a full stop for each change that a user would miss.

    >>> told({"degenerate_faces": 1, "flipped_faces": 298, "components": 3})
    ['1 face without area left out', '298 faces turned to agree with the others around']
    """
    return [_clause(name, count) for name, count in changes.items() if count and name not in UNSAID]


def _clause(name: str, count: int) -> str:
    if name not in WORDS:
        return f"{name.replace('_', ' ')}: {count}"
    form, one, many = WORDS[name].split("|")
    return form.format(f"{count} {one if count == 1 else many}")
