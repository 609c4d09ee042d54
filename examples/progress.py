"""How far it is, and an end after a time: for programs with a window of their own.

`python examples/progress.py`
"""

from __future__ import annotations

import flexpara
from flexpara.runtime.samples import make_sample


def show(stage: str, step: int, steps: int, loss: float | None = None) -> None:
    """Called as the work goes on; loss is that of preset paper."""
    del loss
    print(f"{stage}: {step} of {steps}")


result = flexpara.unwrap(make_sample("trefoil", resolution=8), size=256, time_budget=5.0, progress=show)
print(f"{result.report['metrics']['charts']} charts", *result.report["train"]["notes"])
