"""Memory that was freed is there for the next array without faults, and goes back when that is asked."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from flexpara.runtime.process.heap import keep_freed_memory

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="faults are counted by Linux")

ROUNDS = """
import json, resource, sys
import numpy as np
from flexpara.runtime.process.heap import give_freed_memory_back, keep_freed_memory

def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096

asked = keep_freed_memory() if sys.argv[1] == "keep" else None
np.ones(5_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    np.ones(5_000_000)
faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
held = resident()
give_freed_memory_back()
print(json.dumps({"asked": asked, "faults": faults, "given": held - resident()}))
"""


def rounds(word: str) -> dict[str, int]:
    """Faults of twenty arrays of 40 MB, each freed before the next, and bytes that were given back after."""
    done = subprocess.run([sys.executable, "-c", ROUNDS, word], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_arrays_that_come_and_go_cost_no_faults_and_their_memory_can_be_given_back() -> None:
    kept, plain = rounds("keep"), rounds("plain")
    if not kept["asked"]:
        pytest.skip("another C library than glibc")
    assert kept["faults"] < 100
    assert plain["faults"] > 10 * kept["faults"]
    assert kept["given"] > 30_000_000


def test_elsewhere_nothing_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "darwin")
    assert not keep_freed_memory()
