"""Small studies, made once."""

import numpy as np
import pytest

from tissuq.mechanics import simulate
from tissuq.studies.specimen import SpecimenSettings, run_specimen
from tissuq.validation.paper import PaperSettings, run_paper


@pytest.fixture(scope="session")
def specimen_file(tmp_path_factory):
    """Twelve measurements of a Yeoh material in kPa."""
    truth = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
    data = simulate("yeoh", truth, np.linspace(0.6, 2, 12), noise_sd=0.2, seed=1)
    file = tmp_path_factory.mktemp("data") / "specimen.csv"
    rows = [
        f"{stretch!r},{1000 * stress!r}\n"
        for stretch, stress in zip(data.stretch.tolist(), data.stress.tolist(), strict=True)
    ]
    file.write_text("stretch,stress_kPa\n" + "".join(rows))
    return file


def specimen_study_of(file, *names):
    return run_specimen(SpecimenSettings(file=str(file), discrepancies=names, noise_sd=200.0, seed=5))


@pytest.fixture(scope="session")
def specimen_study(specimen_file):
    return specimen_study_of(specimen_file, "none", "constant", "yeoh", "auto")


@pytest.fixture(scope="session")
def long_specimen_study(specimen_file):
    """The study of more discrepancies, for slow tests."""
    return specimen_study_of(specimen_file, "none", "constant", "mooney-rivlin", "yeoh", "gp", "taylor", "auto")


@pytest.fixture(scope="session")
def paper_study():
    """The study on its own stretch range and one other."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tissuq.validation.paper.study.RANGES", ((0.6, 2.0),))
        return run_paper(PaperSettings(points=10, seed=11))
