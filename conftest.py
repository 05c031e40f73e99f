"""For all tests: a process may map only so many pieces of memory, and every function that JAX compiles takes some."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

import pytest

MAPS, MOST = Path("/proc/self/maps"), 20_000
"""What is mapped (on Linux, where 65530 are allowed), and from how many on compiled functions are let go."""


@pytest.fixture(autouse=True, scope="module")
def few_maps():
    """Let go of compiled functions after a module that has left many."""
    yield
    if "jax" in sys.modules and MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST:
        sys.modules["jax"].clear_caches()
        gc.collect()
