"""The tree of prims of a .usda file: Xforms for the nodes of a scene with its meshes below them, else meshes alone.

Matrices are written for row vectors.  A mesh that stands in several places is written once, in a class that is not
drawn itself, and its places inherit from it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...runtime.io.gltf.instances import standing
from ...runtime.io.gltf.nodes import local_matrix, scene_roots
from .usdmaterial import called, distinct

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...runtime.io.gltf.document import Document
    from ...runtime.io.gltf.nodes import Placement
    from .usdshapes import Shape

PROTOTYPES, MATERIALS = "Prototypes", "Materials"
"""Names of prims below the root that hold what others refer to."""
DEEPEST = 16
"""Levels to which lines are indented."""
ORDER = 'uniform token[] xformOpOrder = ["xformOp:transform"]'


class Prim(NamedTuple):
    """A Mesh: what it has, and the lines between its braces, those of its place left out."""

    shape: Shape
    lines: list[str]


class Waiting(NamedTuple):
    """A node whose turn comes: its number, the prim's name, the world matrix of its parent, its depth."""

    node: int
    name: str
    parent: NDArray[np.float64]
    depth: int


@dataclass(eq=False)
class Tree:
    """The lines so far, and the shapes in the order in which they were written.  root: path of the default prim."""

    root: str
    lines: list[str] = field(default_factory=list)
    written: list[Shape] = field(default_factory=list)

    def add(self, depth: int, *lines: str) -> None:
        """Lines at a depth below the root."""
        self.lines += [f"{'    ' * min(depth, DEEPEST)}{line}" for line in lines]

    def begin(self, depth: int, kind: str, name: str, *metadata: str) -> None:
        """The beginning of a prim, up to its brace."""
        self.add(depth, f'def {kind} "{name}"{" (" if metadata else ""}')
        if metadata:
            self.add(depth, *(f"    {line}" for line in metadata), ")")
        self.add(depth, "{")

    def mesh(self, depth: int, name: str, prim: Prim, matrix: NDArray[np.float64]) -> None:
        """A Mesh at a place, as seen from its parent."""
        schemas = 'prepend apiSchemas = ["MaterialBindingAPI"]'
        self.begin(depth, "Mesh", name, schemas, *called(prim.shape.name, name))
        self.add(depth + 1, *prim.lines, *placed(matrix))
        self.add(depth, "}")
        self.written.append(prim.shape)

    def inherited(self, depth: int, name: str, source: str, matrix: NDArray[np.float64]) -> None:
        """A place of a prototype."""
        self.begin(depth, "Xform", name, "instanceable = true", f"prepend inherits = <{source}>")
        self.add(depth + 1, *placed(matrix))
        self.add(depth, "}")


def node_name(nodes: Sequence[dict[str, Any]], number: int) -> str:
    """The name of a node of the scene, one made of its number where it has none."""
    return str(nodes[number].get("name", f"node_{number}"))


def placed(matrix: NDArray[np.float64]) -> list[str]:
    """The lines of a (4, 4) matrix for column vectors; none where it is the unit matrix."""
    if np.allclose(matrix, np.eye(4), rtol=0.0, atol=1e-12):
        return []
    rows = ", ".join("(" + ", ".join(f"{value:.17g}" for value in row) + ")" for row in matrix.T.tolist())
    return [f"matrix4d xformOp:transform = ( {rows} )", ORDER]


def plain_tree(root: str, prims: Sequence[Prim]) -> Tree:
    """Meshes below the root."""
    tree = Tree(root)
    names = distinct([MATERIALS, *(prim.shape.name for prim in prims)])[1:]
    for name, prim in zip(names, prims, strict=True):
        tree.mesh(1, name, prim, prim.shape.world)
    return tree


def scene_tree(root: str, prims: Sequence[Prim], document: Document) -> Tree:
    """The nodes of the default scene; of others those where a mesh stands that the default scene does not have."""
    tree, own = Tree(root), {prim.shape.mesh: prim for prim in prims}
    count: Counter[int] = Counter()
    at_node: dict[int, list[Placement]] = {}
    for place in standing(document.placements, set(own)):
        at_node.setdefault(place.node, []).append(place)
        count[place.mesh] += 1
    several = [mesh for mesh in own if count[mesh] > 1]
    names = dict(zip(several, distinct(own[mesh].shape.name for mesh in several), strict=True))
    if several:
        tree.add(1, f'class Scope "{PROTOTYPES}"', "{")
        for mesh, name in names.items():
            tree.begin(2, "Xform", name)
            tree.mesh(3, name, own[mesh], np.eye(4))
            tree.add(2, "}")
        tree.add(1, "}")
    nodes = document.file.tree.get("nodes", [])
    roots = _roots(document, set(at_node))
    waiting: list[Waiting | int] = []
    _push(waiting, roots, nodes, np.eye(4), 1, taken=[PROTOTYPES, MATERIALS])
    while waiting:
        turn = waiting.pop()
        if isinstance(turn, int):
            tree.add(turn, "}")
            continue
        local = local_matrix(nodes[turn.node])
        world = turn.parent @ local
        tree.begin(turn.depth, "Xform", turn.name, *called(node_name(nodes, turn.node), turn.name))
        tree.add(turn.depth + 1, *placed(local))
        places = at_node.get(turn.node, [])
        below = distinct(own[place.mesh].shape.name for place in places)
        for name, place in zip(below, places, strict=True):
            seen = np.linalg.pinv(world) @ place.world
            if place.mesh in names:
                tree.inherited(turn.depth + 1, name, f"/{root}/{PROTOTYPES}/{names[place.mesh]}", seen)
            else:
                tree.mesh(turn.depth + 1, name, own[place.mesh], seen)
        waiting.append(turn.depth)
        _push(waiting, nodes[turn.node].get("children", []), nodes, world, turn.depth + 1, taken=below)
    return tree


def _push(
    waiting: list[Waiting | int],
    numbers: Sequence[int],
    nodes: Sequence[dict[str, Any]],
    parent: NDArray[np.float64],
    depth: int,
    taken: Sequence[str],
) -> None:
    """Let nodes wait for their turn, the first on top.  taken: names that siblings have."""
    names = distinct([*taken, *(node_name(nodes, number) for number in numbers)])
    own = zip(numbers, names[len(taken) :], strict=True)
    waiting += reversed([Waiting(number, name, parent, depth) for number, name in own])


def _roots(document: Document, wanted: set[int]) -> list[int]:
    """Root nodes of the default scene, and of others those that have a wanted node below them."""
    nodes = document.file.tree.get("nodes", [])
    first, *others = scene_roots(document.file.tree)
    rest = [root for roots in others for root in roots if root not in first and wanted & _below(nodes, root)]
    return list(dict.fromkeys([*first, *rest]))


def _below(nodes: Sequence[dict[str, Any]], root: int) -> set[int]:
    """The node and all nodes below it."""
    found, waiting = set[int](), [root]
    while waiting:
        node = waiting.pop()
        found.add(node)
        waiting += nodes[node].get("children", [])
    return found
