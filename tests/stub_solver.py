"""A program in the place of CalculiX: from the constants of a neo-Hookean card, result files in its form.

The force on TOP is C10 times the time, at times 0.5 and 1. With a file "fails" beside it that holds a number of a draw,
it fails there half way; with "stiff" it fails so where C10 is beyond the number in it; with "slow" it takes its time;
with "sometimes" it fails the first time that it is run. A deck with the comment ``** finer: 0.9`` has that share of the
force, with ``fails`` there it fails half way, and with ``silent`` the force is not written.
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent


def main(job: str) -> int:
    folder = Path.cwd()
    with (HERE / "started").open("a", encoding="utf-8") as log:
        log.write(f"{folder.name}\n")
    text = Path(f"{job}.inp").read_text(encoding="utf-8")
    coefficient = float(re.search(r"\*HYPERELASTIC, NEO HOOKE\n([^,]+)", text)[1])
    if (HERE / "slow").exists():
        time.sleep(float((HERE / "slow").read_text()))
    if (HERE / "sometimes").exists() and not (HERE / "happened").exists():
        (HERE / "happened").touch()
        print(" *ERROR: no licence")
        return 1
    fails = (HERE / "fails").exists() and f"complete-{(HERE / 'fails').read_text().strip()}" in folder.name
    fails = fails or ((HERE / "stiff").exists() and coefficient > float((HERE / "stiff").read_text()))
    finer = re.search(r"^\*\* finer: (\S+)", text, re.MULTILINE)
    if finer and finer[1].isalpha():
        fails = finer[1] == "fails"
    elif finer:
        coefficient *= float(finer[1])
    times = (0.5,) if fails else (0.5, 1.0)
    tables = [
        f"\n total force (fx,fy,fz) for set TOP and time  {at:.7E}\n\n        0.0 {coefficient * at:.9E} 0.0\n"
        for at in times
    ]
    is_silent = finer is not None and finer[1] == "silent"
    Path(f"{job}.dat").write_text("".join(tables) * (not is_silent), encoding="utf-8")
    rows = [f"     1  {number}     1     2  {at:E}  {at:E}  0.5" for number, at in enumerate(times, start=1)]
    Path(f"{job}.sta").write_text("SUMMARY\n" + "\n".join(rows) + "\n", encoding="utf-8")
    print("best residual\n *ERROR: increment size smaller than minimum\n" if fails else "\n Job finished\n")
    return 201 if fails else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
