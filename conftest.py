"""For all tests: compiled functions, which are kept in the environment from run to run, and let go of within one."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

import pytest

if sys.prefix != sys.base_prefix:  # JAX reads these when it is imported, in the processes that tests start, too
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(sys.prefix) / "jax-cache"))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
if "PYTEST_XDIST_WORKER" in os.environ:  # as many processes as cores: more threads than one in each only get in the way
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

os.environ.setdefault("TISSUQ_PROGRESS", "off")  # lines that depend on how fast the machine is

MEMORY_MAPS, MOST_MAPS = Path("/proc/self/maps"), 12_000
"""What a process has mapped (on Linux, where 65530 are allowed), and from how many on compiled functions are let go."""

SLOW_EXAMPLES = {"fit_population", "patient", "sample_nuts", "sample_smc"}
"""Functions and classes whose examples take more than a few seconds."""

gc.disable()  # until all is collected: what is imported stays, and searching it ever again takes a quarter of the time


def pytest_itemcollected(item: pytest.Item) -> None:
    """Leave the slow examples out of the quick tests."""
    if isinstance(item, pytest.DoctestItem) and item.name.rpartition(".")[2] in SLOW_EXAMPLES:
        item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """Leave what is imported and collected out of every later search for garbage, and search less often."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()


@pytest.fixture(autouse=True, scope="module")
def little_memory(request: pytest.FixtureRequest):
    """Let go, after a module, of what its functions remember, and of compiled functions where these are many."""
    yield
    if isinstance(request.node, pytest.Module):
        for function in vars(request.module).values():
            if getattr(function, "__module__", "") == request.module.__name__ and hasattr(function, "cache_clear"):
                function.cache_clear()
    if "jax" in sys.modules and MEMORY_MAPS.exists() and MEMORY_MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        sys.modules["jax"].clear_caches()
        gc.collect()
