"""An example project to begin from: measured files, a study of them, and the same in Python."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from tissuq.errors import InputError
from tissuq.experiments import datasets

DATASETS = {"brain-cortex-uniaxial": "tension-compression.csv", "brain-cortex-shear": "shear.csv"}
"""Which built-in data sets the project holds, and the names of their files there."""

STUDY = """\
# Both tests in one posterior, each also predicted from the other: tissuq fit study.toml
material = "neo-hookean"
held_out = true

[[tests]]
file = "data/tension-compression.csv"
mode = "uniaxial"

[[tests]]
file = "data/shear.csv"
mode = "simple-shear"
"""

SCRIPT = '''\
"""The same in Python: python analysis.py."""

import tissuq as tq

tests = [tq.read("data/tension-compression.csv", mode="uniaxial"), tq.read("data/shear.csv", mode="simple-shear")]
posterior = tq.fit(tests)
print(posterior.summary())

low, high = posterior.initial_shear_modulus.hdi()
print(f"initial shear modulus: {1000 * low:.2f} to {1000 * high:.2f} kPa (95 %)")
print(posterior.predict(stretch=[1.05, 1.1], mode="planar"))

posterior.save("posterior.nc")
'''

GUIDE = """\
# An example project

Human brain cortex in tension, compression and simple shear (Budday et al. 2017).
Put your own files in place of those in data/.

    tissuq inspect data/tension-compression.csv        # what is understood of a file
    tissuq fit data/tension-compression.csv            # one test
    tissuq fit study.toml                              # both tests, each also predicted from the other
    tissuq predict runs/study --mode planar            # in a loading mode that was not measured
    tissuq export runs/study --format abaqus           # material cards
    python analysis.py                                 # the fit of both tests in Python

Each run leaves a folder in runs/; its report.html opens in a browser.
"""

TEXTS = {"study.toml": STUDY, "analysis.py": SCRIPT, "README.md": GUIDE}


def write_example_project(folder: str | os.PathLike[str]) -> Path:
    """Write the example project into a new or empty folder, and return the folder.

    Parameters
    ----------
    folder : str or path
        Where to write it; folders above it are made.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        When there is a file of that name, or a folder that is not empty.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     sorted(path.name for path in write_example_project(f"{place}/brain").iterdir())
    ['README.md', 'analysis.py', 'data', 'study.toml']
    """
    project = Path(folder)
    if project.exists() and (not project.is_dir() or any(project.iterdir())):
        raise InputError(f"'{project}' is there already and is not an empty folder; name another: tissuq init FOLDER.")
    is_new = not project.exists()
    try:
        (project / "data").mkdir(parents=True)
        for name, file in DATASETS.items():
            shutil.copyfile(datasets.path(name), project / "data" / file)
        for file, text in TEXTS.items():
            (project / file).write_text(text, encoding="utf-8")
    except BaseException:
        for path in [project] if is_new else list(project.iterdir()):
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
        raise
    return project
