"""Plant faults in a copy of the source, one at a time, and see that the tests named beside each fault catch it.

``python tests/mutants.py`` takes all faults, with words after it those whose text holds one of the words. The exit
status is zero where every fault was caught. A fault is found by its text, wherever in the source it stands.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
COPIED = ("src", "tests", "docs", "conftest.py", "pyproject.toml", "README.md", "CONTRIBUTING.md")
PROCESSES = int(os.environ.get("PROCESSES", "2"))
TIME_LIMIT_S = 600
TESTS_FAILED = 1
"""Exit status of pytest where a test has failed; others say that no test has run."""


class Mutant(NamedTuple):
    """A text that stands once in the source, what to write instead, and the tests that must then fail."""

    text: str
    fault: str
    tests: str


MUTANTS = [Mutant(**given) for given in tomllib.loads((Path(__file__).parent / "mutants.toml").read_text())["mutants"]]


def sources_with(text: str, source: Path) -> list[Path]:
    """Return the source files that hold a text, each as often as they hold it."""
    counts = ((file, file.read_text(encoding="utf-8").count(text)) for file in sorted(source.rglob("*.py")))
    return [file for file, count in counts for _ in range(count)]


def is_caught(mutant: Mutant, copy: Path) -> tuple[bool, str]:
    """Plant one fault in a copy, run its tests, take the fault out, and say what the tests said."""
    (file,) = sources_with(mutant.text, copy / "src")
    sound = file.read_text(encoding="utf-8")
    file.write_text(sound.replace(mutant.text, mutant.fault), encoding="utf-8")
    try:
        status, said = run_tests(mutant.tests, copy)
    finally:
        file.write_text(sound, encoding="utf-8")
    return status == TESTS_FAILED, said


def run_tests(tests: str, copy: Path) -> tuple[int, str]:
    """Run tests in a copy until the first that fails: the exit status of pytest, and its last line."""
    words = [f"tests/{word}" if "." in word or "/" in word or (copy / "tests" / word).is_dir() else word
             for word in tests.split()]  # fmt: skip
    command = [sys.executable, "-B", "-m", "pytest", "-x", "-q", "--tb=no", "-p", "no:cacheprovider", *words]
    environment = {**os.environ, "PYTHONPATH": str(copy / "src")}
    try:
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, check=False,
                              timeout=TIME_LIMIT_S)  # fmt: skip
    except subprocess.TimeoutExpired:
        return -1, f"no end after {TIME_LIMIT_S} s"
    return done.returncode, (done.stdout.strip().splitlines() or [done.stderr.strip()])[-1]


def judged(mutants: list[Mutant]) -> Iterator[tuple[Mutant, bool, str]]:
    """Plant every fault, some at a time in as many copies, and say in order which were caught."""
    with TemporaryDirectory() as folder, ThreadPoolExecutor(PROCESSES) as threads:
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(PROCESSES):
            copies.put(copied(Path(folder) / str(number)))

        def judge(mutant: Mutant) -> tuple[Mutant, bool, str]:
            copy = copies.get()
            try:
                return mutant, *is_caught(mutant, copy)
            finally:
                copies.put(copy)

        yield from threads.map(judge, mutants)


def copied(folder: Path) -> Path:
    """Copy what the tests need."""
    folder.mkdir()
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(ROOT / name, folder / name)
    return folder


def main(words: list[str]) -> int:
    """Judge the faults whose text holds one of the words, or all."""
    if find_spec("tissuq") is None:
        print("tissuq is not installed for this Python, without which every test fails: use .venv/bin/python.")
        return 1
    mutants = [mutant for mutant in MUTANTS if not words or any(word in " ".join(mutant) for word in words)]
    caught = 0
    for mutant, good, said in judged(mutants):
        caught += good
        print(f"{'caught  ' if good else 'SURVIVES'}  {mutant.text.strip()}  ->  {mutant.fault.strip()}")
        print(f"          tests/{mutant.tests}: {said}", flush=True)
    print(f"{caught} of {len(mutants)} planted faults caught.")
    return 0 if mutants and caught == len(mutants) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
