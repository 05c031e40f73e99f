"""Read files that were mutated at random: each must be read, or refused with a message, soon and in little memory.

``python tests/fuzz.py --files 10000`` prints what was neither, with the file; ``make fuzz`` runs it.
"""

from __future__ import annotations

import argparse
import io
import os
import random
import resource
import signal
import sys
import tempfile
import traceback
import warnings
import zipfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from machine_files import LAYOUTS
from tissuq.errors import InputError
from tissuq.experiments.reading.tests_in_file import find_tests_in_file

LIMIT_S, LIMIT_GIB = 10, 2
"""Time and memory that reading a file takes at most."""
TOKENS = (
    *["", " ", "\n", "\n\n", "\t", ";", ",", ".", "-", "#", '"', "'", "%", "[", "]", "(", "\0", "\ufeff", "\xb2", "µ"],
    *[
        "kPa",
        "MPa",
        "mm",
        "N",
        "NaN",
        "---",
        "#REF!",
        "1e308",
        "-1e-308",
        "1e999",
        "0",
        "-0",
        "1,5",
        "1.234,5",
        "9" * 40,
    ],
    *[
        "stretch",
        "stress",
        "force",
        "strain",
        "Specimen",
        "S1",
        "9**9**9*Pa",
        "mode: planar",
        "1\t2\t3",
        "a;b;c",
        "1" * 5000,
    ],
)
"""What is put into texts."""


def several_tests() -> dict[str, bytes]:
    """Return files of several tests: beside one another, beneath one another, in rows of several specimens."""
    steps = range(30)
    wide = ["Strain,Stress S1 [kPa],Stress S2 [kPa]", *(f"{k / 100},{k},{2 * k}" for k in steps)]
    table = ["Time\tDisplacement\tForce", "s\tmm\tN", *(f"{k}\t{k / 10}\t{k / 5}" for k in steps), ""]
    rows = ["Specimen;stretch;stress [kPa]", *(f"{name};{1 + k / 100};{k}" for name in "AB" for k in steps)]
    return {
        "wide.csv": "\n".join(wide).encode(),
        "steps.txt": "\n".join(["[step]", "Tension - 1", *table, "[step]", "Tension - 2", *table]).encode(),
        "rows.csv": "\n".join(rows).encode(),
    }


def workbook() -> bytes:
    """Return a workbook with two sheets."""
    import openpyxl

    book, content = openpyxl.Workbook(), io.BytesIO()
    for sheet in (book.active, book.create_sheet("shear")):
        sheet.append(["strain", "stress [kPa]"])
        for step in range(20):
            sheet.append([step / 100, float(step)])
    book.save(content)
    return content.getvalue()


def mutated(content: bytes, chance: random.Random) -> bytes:
    """Return bytes with a few changes: in a text of words and lines, in a workbook of the texts within, or of bytes."""
    if content.startswith(b"PK") and chance.random() < 0.8:
        return _archive_mutated(content, chance)
    for _ in range(chance.randint(1, 6)):
        content = chance.choice([_bytes_changed, _lines_changed, _token_put_in])(content, chance)
    return content


def _archive_mutated(content: bytes, chance: random.Random) -> bytes:
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as archive, zipfile.ZipFile(changed, "w") as copy:
        names = archive.namelist()
        chosen = chance.choice(names)
        for name in names:
            part = archive.read(name)
            copy.writestr(name, _token_put_in(part, chance) if name == chosen else part)
    return changed.getvalue()


def _bytes_changed(content: bytes, chance: random.Random) -> bytes:
    start = chance.randrange(len(content) + 1)
    stop = min(len(content), start + chance.choice([0, 1, 1, 4, 50]))
    return content[:start] + chance.randbytes(chance.choice([0, 1, 1, 8])) + content[stop:]


def _lines_changed(content: bytes, chance: random.Random) -> bytes:
    lines = content.split(b"\n")
    first, second = chance.randrange(len(lines)), chance.randrange(len(lines))
    kind = chance.randrange(4)
    if kind == 0:
        del lines[first : first + chance.choice([1, 1, 5, len(lines)])]
    elif kind == 1:
        lines[first], lines[second] = lines[second], lines[first]
    elif kind == 2:
        lines[first:first] = lines[second : second + chance.choice([1, 10, len(lines)])]
    else:
        lines[first] = lines[first] * chance.choice([2, 100])
    return b"\n".join(lines)


def _token_put_in(content: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(content) + 1)
    return content[:place] + chance.choice(TOKENS).encode() + content[place + chance.choice([0, 0, 1, 3]) :]


def fault(task: tuple[str, bytes, dict, int]) -> str:
    """Return what reading a file ended in that is neither a test nor a message; an empty text for nothing."""
    name, content, options, seed = task
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_GIB * 2**30, resource.RLIM_INFINITY))
    signal.signal(signal.SIGALRM, _too_long)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder) / name
        path.write_bytes(mutated(content, random.Random(seed)))
        signal.alarm(LIMIT_S)
        try:
            find_tests_in_file(path, **options)
        except InputError:
            return ""
        except BaseException:  # whatever else it is, is what is looked for
            return f"{name}, seed {seed}: {traceback.format_exc(limit=-3)}"
        finally:
            signal.alarm(0)
    return ""


def _too_long(*_: object) -> None:
    raise TimeoutError(f"longer than {LIMIT_S} s")


def tasks(count: int, seed: int) -> Iterator[tuple[str, bytes, dict, int]]:
    """Yield files in turn, each with the options that read it and a seed of its mutations."""
    files = [(file.name, file.content, file.options) for file in (layout() for layout in LAYOUTS.values())]
    sizes = {"dimensions": {"length": "10 mm", "area": "10 mm2"}}
    files += [(name, content, sizes if name == "steps.txt" else {}) for name, content in several_tests().items()]
    files.append(("book.xlsx", workbook(), {}))
    for number in range(count):
        yield *files[number % len(files)], seed + number


def main() -> None:
    """Read mutated files, and print what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        faults = [text for text in pool.map(fault, tasks(options.files, options.seed), chunksize=20) if text]
    print(*faults[:20], f"{len(faults)} faults in {options.files} files", sep="\n")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
