"""Where the searches of a part begin, how many there are, and the best of them.   f faces · a part has area 1."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic
from ..search.labels import dual_graph
from ..search.search import Search
from ..search.starts import clusters, pieces_by_score
from ..workers import parallel_map
from .given import as_start
from .haste import Haste
from .objective import rank
from .proof import is_valid

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Piece
    from ..search.labels import DualGraph
    from .parts import Part

    Scores = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Known(NamedTuple):
    """What was found elsewhere.

    scores: (n, 3) points in the surface's units → (n, k) log chart probabilities: the one start of each search.
    corner_uv: (f, 3, 2) of an atlas, in any unit: a start beside those from geometry, and no result is worse than it.
    """

    scores: Scores | None = None
    corner_uv: NDArray[np.float64] | None = None


NOTHING = Known()


@dataclass(frozen=True)
class Starts:
    """Where the searches of a part begin.

    share: of the whole surface's area, which decides how long is searched.  given: an atlas of the part, made valid.
    haste: how near the deadline is.
    """

    part: Part
    charts: int
    share: float
    config: FinishConfig
    seed: int
    scores: Scores | None
    haste: Haste = field(default_factory=Haste)
    given: Search | None = None

    def late(self) -> bool:
        """Whether searches have to end."""
        return self.haste.late()

    @cached_property
    def is_hopeless(self) -> bool:
        """Whether no search is begun at all, since there is no time to lay out what it would find."""
        return self.haste.is_hopeless(len(self.part.ids), self.handles, thinned=self.many)

    @property
    def faces(self) -> int:
        """Faces of the proxy."""
        most = self.config.proxy_faces
        plain = int(np.clip(most * np.sqrt(self.share), min(self.config.fewest_faces, most), most))
        return max(plain, self.config.faces_per_handle * self.handles)

    @property
    def middle(self) -> int:
        """Faces of the middle mesh."""
        fine = self.config.fine
        return max(round(fine.faces * np.sqrt(self.share)), min(fine.fewest, fine.faces))

    @property
    def carried(self) -> bool:
        """Whether charts are found on another mesh than the part's, a thinned one or one without noise."""
        return self.many or self.part.surface.calm is not None

    @property
    def many(self) -> bool:
        """Whether the part has so many faces that it is thinned."""
        return len(self.part.surface.faces) > self.config.fine.above * self.middle

    @property
    def whole(self) -> int:
        """Faces up to which a part that unfolds is searched as it is."""
        return max(round(self.config.whole_faces * np.sqrt(self.share)), self.faces)

    @cached_property
    def handles(self) -> int:
        """The genus of the part."""
        faces = self.part.surface.faces
        return max((2 - len(boundary_loops(faces)) - euler_characteristic(faces)) // 2, 0)

    @property
    def small(self) -> bool:
        """Whether the part is a small share of the surface."""
        return self.share < self.config.start.worth

    @property
    def holed(self) -> bool:
        """Whether the part is a small share of the surface, and has so many handles that straight seams take long."""
        return self.small and self.handles > self.config.start.handles

    @property
    def counts(self) -> tuple[float, ...]:
        """Clusters of each start, as a multiple of the charts asked for."""
        start = self.config.start
        if self.handles > start.handles:
            return start.counts_holed
        if self.small:
            return start.counts_small
        return start.counts if self.share >= start.main else start.counts_middle

    def cluster_counts(self, counts: tuple[float, ...], faces: int) -> tuple[int, ...]:
        """How many clusters each start of a proxy of so many faces has."""
        least = max(round(self.handles / self.config.handles_per_cluster), 1)
        most = max(faces // self.config.start.least_faces, 1)
        return tuple(min(max(round(each * self.charts), least), most) for each in counts)

    def labels(self, surface: Surface, graph: DualGraph, count: int, number: int) -> NDArray[np.int64]:
        """Connected pieces (f,), numbered 0…, of the proxy, of so many clusters, or by scores: of one of the starts."""
        if self.scores is None:
            return clusters(surface, graph, count, self.config, np.random.default_rng([self.seed, number]))
        points = surface.triangles.mean(axis=1) * self.part.scale + self.part.origin
        return pieces_by_score(self.scores(points), surface.face_areas(), graph, self.config.labels)


def best_search(
    surface: Surface, charts: int, starts: Starts, config: FinishConfig, unfolded: list[Piece]
) -> list[Search]:
    """The search of lowest objective among several starts, and what it becomes as more charts are allowed.

    ``unfolded``: the part's flat charts, another start.
    """
    graph = dual_graph(surface, edge_table(surface.faces), config.labels.seams)
    begun = []
    if unfolded:
        search = Search(surface, graph, config)
        valid = [is_valid(piece) for piece in unfolded]
        for piece in compress(unfolded, valid):
            search.add(piece)
        search.add_all_valid([(piece.ids, ()) for piece, whole in zip(unfolded, valid, strict=True) if not whole])
        search.begin(starts.late)
        begun.append(search)
    if not unfolded or starts.share >= config.start.main:
        begun += begun_searches(surface, graph, starts, starts.counts)
    if starts.small and min(search.energy() for search in begun) > config.most_excess:
        begun += begun_searches(surface, graph, starts, config.start.counts)
    if starts.given is not None and len(starts.given.pieces) <= config.start.given:
        begun.append(laid_out(surface, graph, as_start(starts.given, surface, graph), config).begin(starts.late))
    by_cost = {search.objective(): search for search in begun}  # starts that came to the same are one
    ahead = [search for cost, search in by_cost.items() if cost <= config.start.behind * min(by_cost)]
    rounds = config.few_rounds if starts.small else config.rounds
    few = config.closing.charts

    def finished(search: Search, most: int) -> Search:
        return search.finish(most, rounds, starts.late, starts.haste.last)

    ahead = parallel_map(lambda search: finished(search, few), ahead)
    bests = [min(ahead, key=lambda search: rank(list(search.pieces.values()), surface, few, config))]
    while few < charts and len(bests[-1].pieces) >= few:
        few = min(2 * few, charts)
        more = finished(bests[-1].twin(), few)
        if more.objective() < bests[-1].objective():
            bests.append(more)
    return bests[-1:] if config.stretch else bests


def begun_searches(surface: Surface, graph: DualGraph, starts: Starts, counts: tuple[float, ...]) -> list[Search]:
    """A search from each start, as far as merges pay.

    Where the first has so many pieces that it takes its time, it is the only one: another would not be much better.
    """
    sizes = starts.cluster_counts(counts if starts.scores is None else counts[:1], len(surface.faces))

    def laid(number: int) -> Search:
        return laid_out(surface, graph, starts.labels(surface, graph, sizes[number], number), starts.config)

    first = laid(0)
    if starts.late() or len(first.pieces) > starts.config.start.crowded:
        return [first.begin(starts.late)]
    numbers = range(len(sizes))
    return parallel_map(lambda n: (laid(n) if n else first).begin(starts.late), numbers, lambda n: sizes[n])


def laid_out(surface: Surface, graph: DualGraph, label: NDArray[np.int64], config: FinishConfig) -> Search:
    """A search of the pieces that labels (f,) name."""
    search = Search(surface, graph, config)
    search.add_all_valid([(np.flatnonzero(label == piece), ()) for piece in range(int(label.max()) + 1)])
    return search
