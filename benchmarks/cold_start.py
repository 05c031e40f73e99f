"""Whole-process wall times of the exact route, cold: `tissuq --help` and the paper's study without figures.

Run with `make bench`. Each command is run several times after one warm-up; the median is what to quote.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

RUNS = 7
COMMANDS = {
    "tissuq --help": ["--help"],
    "tissuq paper --method exact --no-figures": ["paper", "--method", "exact", "--no-figures", "--force"],
}


def main() -> None:
    """Print minimum, median and maximum wall time of every command."""
    program = Path(sys.executable).with_name("tissuq")
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in COMMANDS.items():
            out = ["--out", f"{folder}/run"] if "paper" in arguments else []
            seconds = []
            for _ in range(RUNS + 1):
                start = perf_counter()
                subprocess.run([program, *arguments, *out], check=True, capture_output=True)
                seconds.append(perf_counter() - start)
            low, middle, high = min(seconds[1:]), statistics.median(seconds[1:]), max(seconds[1:])
            print(f"{name}: median {middle:.2f} s ({low:.2f} to {high:.2f}, {RUNS} runs)")


if __name__ == "__main__":
    main()
