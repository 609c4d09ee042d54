"""Forks after torch was used: refused with the remedy, at once; whole processes and single threads are not."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("torch")

PROGRAM = """
import os, signal, sys
import flexpara
from flexpara.runtime.errors import FlexparaError
from flexpara.runtime.extras import requires

{before}
child = os.fork()
if child == 0:
    signal.alarm(20)
    {inside}
    try:
        with requires("train"):
            import torch
        print("fine", flush=True)
    except FlexparaError as error:
        print(error, flush=True)
    os._exit(0)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def said(before: str, inside: str = "pass") -> str:
    """What a forked copy prints that is about to use torch; ``before`` is done by its parent."""
    program = PROGRAM.format(before=before, inside=inside)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout


def test_a_fork_after_torch_is_refused_and_names_spawn() -> None:
    line = said("import torch; torch.set_num_threads(2); torch.rand(4_000_000).exp()")
    assert "forked from process" in line
    assert "spawn" in line


def test_a_fork_before_torch_may_train() -> None:
    assert said("pass") == "fine\n"


def test_a_fork_with_one_thread_may_train() -> None:
    assert said("import torch", "torch.set_num_threads(1)") == "fine\n"


def test_a_forked_pool_hands_the_refusal_to_its_owner() -> None:
    program = """
import multiprocessing
import flexpara, torch
torch.set_num_threads(2)
triangle = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]])
with multiprocessing.get_context("fork").Pool(1) as pool:
    try:
        pool.map(flexpara.unwrap, [triangle])
    except flexpara.FlexparaError as error:
        print(error)
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    assert 'get_context("spawn")' in done.stdout
