import subprocess
import sys

import numpy as np
import pytest

from tissuq.errors import InputError
from tissuq.experiments import datasets


def test_the_data_sets_are_listed():
    rubber = [f"rubber-treloar-{mode}" for mode in ("equibiaxial", "planar", "uniaxial")]
    silicone = [f"silicone-meunier-{mode}" for mode in ("equibiaxial", "planar", "uniaxial")]
    assert datasets.names() == ["brain-cortex-shear", "brain-cortex-uniaxial", *rubber, *silicone]


@pytest.mark.parametrize("name", datasets.names())
def test_every_data_set_can_be_fitted(name):
    data = datasets.load(name)
    assert len(data) > 10
    assert np.sign(data.stress[np.abs(data.stress).argmax()]) in (-1, 1)


@pytest.mark.parametrize("name", datasets.names())
def test_every_data_file_tells_its_citation_mode_and_columns(name):
    comments = [line for line in datasets.path(name).read_text("utf-8").splitlines() if line.startswith("#")]
    for key in ("title", "citation", "mode", "columns"):
        assert any(line.startswith(f"# {key}: ") for line in comments)


def test_brain_tissue_in_tension_and_compression_is_loaded_in_mpa():
    brain = datasets.load("brain-cortex-uniaxial")
    assert len(brain) == 34
    assert (brain.mode.name, brain.name, brain.stress_unit) == ("uniaxial", "brain-cortex-uniaxial", "kPa")
    at_the_ends = dict(zip(brain.stretch.tolist(), brain.stress.tolist(), strict=True))
    assert at_the_ends[1.1] == pytest.approx(0.4151e-3)
    assert at_the_ends[0.9] == pytest.approx(-1.1484e-3)
    assert "Budday et al. 2017" in brain.source
    assert "Linka" in brain.source


def test_treloar_rubber_is_loaded():
    rubber = datasets.load("rubber-treloar-uniaxial")
    assert len(rubber) == 21
    assert (rubber.stretch[0], rubber.stress[0]) == (1.0, 0.0)
    assert (rubber.stretch[-1], rubber.stress[-1]) == (7.512, 5.5639)
    assert np.all(np.diff(rubber.stretch) > 0)
    assert "Treloar 1944" in rubber.source


def test_a_table_has_the_columns_of_the_file():
    brain = datasets.table("brain-cortex-uniaxial")
    assert list(brain.columns) == ["test", "stretch", "stress_kPa"]
    assert brain["test"].value_counts().to_dict() == {"tension": 17, "compression": 17}


def test_brain_tissue_in_simple_shear_is_loaded_in_mpa():
    shear = datasets.load("brain-cortex-shear")
    assert (shear.mode.name, shear.stress_unit, len(shear)) == ("simple-shear", "kPa", 17)
    assert (shear.stretch[0], shear.stretch[-1]) == (0.0, 0.2)
    assert shear.stress[-1] == pytest.approx(0.5435e-3)
    assert "amount of shear = column 'shear'" in shear.source
    assert datasets.table("brain-cortex-shear").iloc[-1].to_dict() == {"shear": 0.2, "stress_kPa": 0.5435}


@pytest.mark.parametrize("function", [datasets.load, datasets.table, datasets.path])
def test_an_unknown_data_set_is_answered_with_those_there_are(function):
    with pytest.raises(InputError, match=r"no data set named 'brain-cortex'.*Did you mean.*rubber-treloar-uniaxial"):
        function("brain-cortex")


def test_a_data_set_is_copied_into_a_new_folder(tmp_path):
    copied = datasets.copy("rubber-treloar-uniaxial", tmp_path / "new" / "folder")
    assert copied == tmp_path / "new" / "folder" / "rubber-treloar-uniaxial.csv"
    assert copied.read_bytes() == datasets.path("rubber-treloar-uniaxial").read_bytes()


def test_a_copy_overwrites_only_when_forced(tmp_path):
    target = tmp_path / "brain-cortex-shear.csv"
    target.write_text("my own work")
    with pytest.raises(InputError, match=r"brain-cortex-shear\.csv is already there; give force=True"):
        datasets.copy("brain-cortex-shear", tmp_path)
    assert target.read_text() == "my own work"
    datasets.copy("brain-cortex-shear", tmp_path, force=True)
    assert target.read_text() != "my own work"


def test_a_copy_into_what_is_not_a_folder_is_refused(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        datasets.copy("brain-cortex-shear", file)


def test_listing_and_loading_need_neither_pandas_nor_pint():
    code = (
        "import sys; from tissuq.experiments import datasets; datasets.load('brain-cortex-uniaxial')\n"
        "sys.exit(bool({'pandas', 'pint'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
