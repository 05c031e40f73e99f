"""Seconds from the upload of a test to its answer, and to its report, in the page that `tissuq app` serves.

A test has 40 points and is fitted with the discrepancy `auto`; every repetition has other noise. The first fit waits
until the process that fits is warm, and is not counted. It needs the extra `app`: `python benchmarks/app_fit.py`.
"""

from __future__ import annotations

import json
import re
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any
from urllib.request import Request, urlopen

import numpy as np

REPETITIONS = 7


def main() -> None:
    """Print median, smallest and largest number of seconds."""
    program = Path(sys.executable).with_name("tissuq")
    served = subprocess.Popen([program, "app", "--no-browser"], stdout=subprocess.PIPE, text=True)
    assert served.stdout is not None  # noqa: S101 (it is a pipe)
    try:
        address = next(found[0] for line in served.stdout if (found := re.search(r"http://\S+", line)))
        session = _send(f"{address}sessions")["session"]
        seconds = [_seconds(f"{address}sessions/{session}", number) for number in range(REPETITIONS + 1)][1:]
    finally:
        served.terminate()
        served.wait()
    for what, column in zip(("the answer", "the report"), zip(*seconds, strict=True), strict=True):
        low, middle, high = min(column), statistics.median(column), max(column)
        print(f"from upload to {what}: median {middle:.2f} s ({low:.2f} to {high:.2f}, {REPETITIONS} fits)")


def _seconds(address: str, number: int) -> tuple[float, float]:
    """Return the seconds from the upload of a test to its answer, and to its report."""
    stretch = np.linspace(1.01, 1.5, 40)
    stress = 10 * (stretch - stretch**-2) * (1 + 0.5 * (stretch - 1))
    stress += np.random.default_rng(number).normal(0, 0.05, 40)
    rows = "".join(f"{x:.6f},{y:.6f}\n" for x, y in zip(stretch, stress, strict=True))
    text = f"# mode: uniaxial\nstretch,stress [kPa]\n{rows}".encode()
    start = perf_counter()
    file = _send(f"{address}/files?name=test-{number}.csv", text)["name"]
    task = _send(f"{address}/tasks/fit", json.dumps({"files": [file]}).encode())["task"]
    at = {}
    for news in _news(f"{address}/news"):
        if news.get("task") == task:
            at.setdefault(news["kind"], perf_counter() - start)
        if "error" in at:
            sys.exit(f"the fit failed: {news}")
        if "done" in at:
            break
    return at["answer"], at["done"]


def _send(address: str, body: bytes = b"") -> Any:
    with urlopen(Request(address, body, method="POST")) as answer:  # noqa: S310 (this computer's own page)
        return json.load(answer)


def _news(address: str) -> Iterator[dict[str, Any]]:
    with urlopen(address) as lines:  # noqa: S310
        for line in lines:
            if line.startswith(b"data: "):
                yield json.loads(line[6:])


if __name__ == "__main__":
    main()
