"""Which parts of a glTF document refer to which by number, and a document without those that nothing refers to.

Words of the specification (Khronos, glTF 2.0.1): accessor, bufferView, image, texture, sampler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    Reference = tuple[str, Any, Any]

ARRAYS = ("textures", "samplers", "images", "accessors", "bufferViews")
"""What is numbered anew, those first that refer to the later ones."""
DRACO = "KHR_draco_mesh_compression"
UNDERSTOOD = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_punctual", "KHR_mesh_quantization")
UNDERSTOOD += (DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression", "EXT_mesh_gpu_instancing", "KHR_xmp")
UNDERSTOOD += ("KHR_animation_pointer", "KHR_node_visibility", "MSFT_texture_dds")
"""Beginnings of extensions whose references are known; others may refer to anything by number."""


def references(tree: dict[str, Any]) -> Iterator[Reference]:
    """(array, holder, key) of each number: holder[key] is a number of tree[array]."""
    yield from _of_meshes(tree)
    for node in tree.get("nodes", []):
        attributes = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {})
        yield from (("accessors", attributes, name) for name in attributes)
    for skin in tree.get("skins", []):
        yield from _given("accessors", skin, "inverseBindMatrices")
    for animation in tree.get("animations", []):
        for sampler in animation.get("samplers", []):
            yield from _given("accessors", sampler, "input", "output")
    for accessor in tree.get("accessors", []):
        yield from _given("bufferViews", accessor, "bufferView")
        for part in ("indices", "values"):
            yield from _given("bufferViews", accessor.get("sparse", {}).get(part, {}), "bufferView")
    for image in tree.get("images", []):
        yield from _given("bufferViews", image, "bufferView")
    for texture in tree.get("textures", []):
        yield from _given("samplers", texture, "sampler")
        for holder in (texture, *texture.get("extensions", {}).values()):
            yield from _given("images", holder, "source")
    for material in tree.get("materials", []):
        yield from (("textures", info, "index") for info in texture_infos(material))


def _of_meshes(tree: dict[str, Any]) -> Iterator[Reference]:
    for primitive in (primitive for mesh in tree.get("meshes", []) for primitive in mesh["primitives"]):
        yield from _given("accessors", primitive, "indices")
        for names in (primitive["attributes"], *primitive.get("targets", [])):
            yield from (("accessors", names, name) for name in names)
        yield from _given("bufferViews", primitive.get("extensions", {}).get(DRACO, {}), "bufferView")


def _given(array: str, holder: dict[str, Any], *keys: str) -> Iterator[Reference]:
    yield from ((array, holder, key) for key in keys if key in holder)


def texture_infos(part: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Every textureInfo of a material, those of its extensions included: objects with an index, named …Texture."""
    for name, value in part.items():
        if not isinstance(value, dict) or name == "extras":
            continue
        if name.lower().endswith("texture") and isinstance(value.get("index"), int):
            yield value
        else:
            yield from texture_infos(value)


def extensions_in(value: Any) -> set[str]:
    """Names of all extensions that some object of the document has."""
    if isinstance(value, list):
        return set().union(*(extensions_in(entry) for entry in value))
    if not isinstance(value, dict):
        return set()
    inside = set().union(*(extensions_in(entry) for name, entry in value.items() if name != "extras"))
    own = value.get("extensions")
    return inside | set(own) if isinstance(own, dict) else inside


def prune(tree: dict[str, Any]) -> None:
    """Take out, in place, what nothing refers to; nothing where an extension is there that may refer to anything."""
    if not all(name.startswith(UNDERSTOOD) for name in extensions_in(tree)):
        return
    for array in ARRAYS:
        if array not in tree:
            continue
        found = [reference for reference in references(tree) if reference[0] == array]
        used = sorted({holder[key] for _, holder, key in found})
        number = {old: new for new, old in enumerate(used)}
        changed = [(holder, key, number[holder[key]]) for _, holder, key in found]
        for holder, key, new in changed:
            holder[key] = new
        tree[array] = [tree[array][old] for old in used]
        if not used:
            del tree[array]
