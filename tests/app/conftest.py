"""Files of measurements, and a page that is served."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("starlette", reason="the extra 'app' is not installed")
pytest.importorskip("uvicorn", reason="the extra 'app' is not installed")


SERVED = """\
from tissuq.app.server import serve
if __name__ == "__main__":
    serve(open_browser=False, grace=1.0)
"""
"""As ``tissuq app --no-browser``, but for how long it waits for a page that has gone."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _write_stretches(folder: Path, name: str = "kidney.csv", heading: str = "stretch,stress [kPa]", c10: float = 5.0):
    """Write 40 rows of uniaxial tension of a neo-Hookean solid, with 2 C10 = 10 kPa and noise of 0.05 kPa."""
    stretch = np.linspace(1.01, 1.5, 40)
    stress = 2 * c10 * (stretch - stretch**-2) + np.random.default_rng(1).normal(0, 0.05, 40)
    rows = "".join(f"{x:.6f},{y:.6f}\n" for x, y in zip(stretch, stress, strict=True))
    (folder / name).write_text(f"{heading}\n{rows}", encoding="utf-8")
    return folder / name


def _write_machine(folder: Path, name: str = "skin.csv"):
    """Write what a machine records of a strip of 5 by 2 mm, of which nobody knows the length: out, and back lower."""
    out = np.linspace(0, 4, 60)
    displacement = np.concatenate([out, out[::-1]])
    stress = 20 * ((1 + displacement / 12) - (1 + displacement / 12) ** -2)  # kPa = mN/mm2
    force = stress / 1000 * 10 * np.repeat([1.0, 0.7], 60) + np.random.default_rng(2).normal(0, 0.0005, 120)
    rows = "".join(f"{d:.5f};{f:.6f}\n" for d, f in zip(displacement, force, strict=True))
    text = f"Width: 5 mm; Thickness: 2 mm\nExtension (mm);Load (N)\n{rows}"
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


@pytest.fixture(scope="session")
def write_stretches():
    return _write_stretches


@pytest.fixture(scope="session")
def write_machine():
    return _write_machine


@pytest.fixture(scope="session")
def served(tmp_path_factory):
    """The address of a page that another process serves, and the folder of that process's temporary files."""
    folder = tmp_path_factory.mktemp("served")
    (folder / "served.py").write_text(SERVED, encoding="utf-8")
    scratch = folder / "scratch"
    scratch.mkdir()
    environment = {**os.environ, "TMPDIR": str(scratch), "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, folder / "served.py"], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    )
    try:
        said = process.stdout.readline()
        threading.Thread(target=process.stdout.read, daemon=True).start()
        yield re.search(r"http://\S+", said)[0], scratch
    finally:
        process.terminate()
        process.wait(30)
    assert not list(scratch.glob("tissuq-app-*")), "temporary files are left"


@pytest.fixture(scope="session")
def address(served):
    return served[0]


@pytest.fixture(scope="session")
def scratch(served):
    return served[1]
