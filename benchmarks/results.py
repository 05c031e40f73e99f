"""RESULTS.md: one section a benchmark, each with the machine, the versions and the command of its measurement."""

from __future__ import annotations

import os
import platform
import re
import statistics
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

__all__ = ["begin", "median_and_range", "table", "write_section"]

RESULTS = Path(__file__).with_name("RESULTS.md")
HEAD = """# Benchmark results

Measured, not promised: every section says on what and with which command. Written by `make bench`; do not edit.
"""


def begin(command: str, packages: Iterable[str]) -> str:
    """Return the sentence that says when, on what and with what is measured, as of now."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    versions = ", ".join(found for found in map(_versioned, packages) if found)
    return (
        f"Measured on {datetime.now(UTC):%Y-%m-%d} with `{command}` on {len(os.sched_getaffinity(0))} cores "
        f"({_processor()}), {memory:.0f} GiB of memory, {platform.system()}, Python {platform.python_version()}; load "
        f"of other processes when it began: {os.getloadavg()[0]:.1f}. Versions: {versions}."
    )


def write_section(title: str, *parts: str) -> None:
    """Print a section and put it into RESULTS.md, in place of the one with the same title."""
    section = "\n\n".join((f"## {title}", *parts)) + "\n"
    print(section)
    text = RESULTS.read_text() if RESULTS.exists() else HEAD
    old = re.compile(rf"^## {re.escape(title)}\n.*?(?=^## |\Z)", re.DOTALL | re.MULTILINE)
    kept = old.sub("", text).rstrip()
    RESULTS.write_text(f"{kept}\n\n{section}")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def median_and_range(values: Sequence[float], digits: int = 1) -> str:
    """Return a median, with the range when there is one."""
    middle = f"{statistics.median(values):.{digits}f}"
    return middle if len(values) == 1 else f"{middle} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def _versioned(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return ""


def _processor() -> str:
    found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    return found[1] if found else platform.machine()
