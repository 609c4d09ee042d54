"""What `flexpara batch` may be asked beside the options of each unwrap: see unwrap.py, whose rules hold here too."""

import re
from dataclasses import dataclass

from .unwrap import demand
from .words import Flag

RAY = re.compile(r"local|(ray://)?[\w.-]+:\d{1,5}")
UNITS = {"": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9}


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """How many assets are worked on, where, and what one may take.

    Raises: InputError for a value outside what its field allows.
    """

    workers: str = "auto"
    """Worker processes, each with cores of its own; auto is one for each core."""
    ray: str | None = None
    """Work on the machines of a Ray cluster: HOST:PORT of its head, or local for one on this machine.  Its machines see
    the same folders, and have the same flexpara; needs flexpara[fleet]."""
    shard: str | None = None
    """Which of several equal shares of the assets this machine takes, as 3/16: the third of sixteen."""
    per_asset_seconds: float | None = None
    """Seconds that an asset may take.  At 60 % of them its search ends with the best charts so far; an asset that takes
    longer all the same is given up.  By default as long as it takes."""
    per_asset_memory: str | None = None
    """Memory that an asset may take, as 4GB or 800MB; at 80 % of it its search ends with the best charts so far."""
    retry_failed: Flag = False
    """Try again what failed before and has not changed since."""
    dry_run: Flag = False
    """Say what would be done, and do nothing."""

    def __post_init__(self) -> None:
        fits = self.workers == "auto" or (self.workers.isdigit() and int(self.workers) >= 1)
        demand(fits, f"workers is {self.workers!r}, expected auto or a number from 1; pass for instance --workers 2")
        found = f"ray is {self.ray!r}, expected local or HOST:PORT"
        demand(self.ray is None or RAY.fullmatch(self.ray) is not None, f"{found}; pass for instance --ray local")
        found = f"workers is {self.workers} beside ray {self.ray}, expected auto"
        demand(self.ray in (None, "local") or self.workers == "auto", f"{found}, as the cluster knows; leave it out")
        first, count = self.share
        found = f"shard is {self.shard!r}, expected N/M with N from 1 to M"
        demand(1 <= first <= count, f"{found}; pass for instance --shard 3/16")
        seconds = self.per_asset_seconds
        found = f"per-asset-seconds is {seconds}, expected above 0"
        demand(seconds is None or seconds > 0, f"{found}; pass for instance --per-asset-seconds 120")
        found = f"per-asset-memory is {self.per_asset_memory!r}, expected a size"
        demand(self.per_asset_memory is None or self.bytes > 0, f"{found}; pass for instance --per-asset-memory 4GB")

    @property
    def share(self) -> tuple[int, int]:
        """(N, M) of shard N/M; (1, 1) where there is none, (0, 0) for what is none."""
        found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", self.shard or "1/1")
        return (int(found[1]), int(found[2])) if found else (0, 0)

    @property
    def mark(self) -> str:
        """What the files of a share have in their names: "-3-of-16"; nothing where there is one share."""
        first, count = self.share
        return f"-{first}-of-{count}" if count > 1 else ""

    @property
    def bytes(self) -> int:
        """The memory of an asset; 0 where there is no limit, or no size is given."""
        found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(KB|MB|GB|)", (self.per_asset_memory or "0").upper())
        return int(float(found[1]) * UNITS[found[2]]) if found else 0
