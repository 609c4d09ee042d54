"""How near a deadline is: whether searches have to end, whether layouts have to, and what is not even begun.

Whoever asks for the best so far ends searches; a budget alone ends layouts, and only where it is strict.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ...runtime.process.deadline import Deadline
from ..carry.config import HasteConfig
from ..workers import available_cores


@dataclass(frozen=True)
class Haste:
    """A deadline, as a surface of so many faces sees it; by default there is none."""

    deadline: Deadline = field(default_factory=Deadline)
    faces: int = 0
    config: HasteConfig = field(default_factory=HasteConfig)
    cores: int = field(default_factory=available_cores)

    def late(self) -> bool:
        """Whether searches have to end: what follows them takes all the time that is left."""
        search = self.config.seconds + self.config.seconds_per_face * self.faces
        return self.deadline.passed(max(search, self.reserve()))

    def last(self) -> bool:
        """Whether layouts have to end: what has none is projected."""
        return self.config.strict and self.deadline.is_spent(self.reserve())

    @property
    def speed(self) -> float:
        """How many times as fast as one core all of them are."""
        return 1.0 + self.config.another * (self.cores - 1)

    def reserve(self) -> float:
        """Seconds for projecting, proving and packing the whole surface."""
        config = self.config
        return config.last + (config.proving + config.projecting / self.speed) * self.faces

    @property
    def is_strict(self) -> bool:
        """Whether there is a budget that counts more than good charts."""
        return self.config.strict and self.deadline.seconds is not None

    def left(self) -> float:
        """Seconds until all charts have to be there."""
        return self.deadline.left - self.config.last - self.config.proving * self.faces

    def is_hopeless(self, faces: int, handles: int = 0, *, thinned: bool = True) -> bool:
        """Whether it is so late that a part would be thinned and searched, and then not half of it laid out."""
        if not self.config.strict or not self.late():
            return False
        thinning = self.config.thinning * faces if thinned else 0.0
        shared = self.config.laying * faces + self.config.handle * handles
        return self.deadline.is_spent(self.reserve() + thinning + shared / self.speed)
