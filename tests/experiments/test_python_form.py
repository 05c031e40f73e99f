"""Messages about tables in memory propose what a person in Python can type, and no options of the shell."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.experiments.reading.options import READING_OPTIONS, spelled_out
from tissuq.experiments.reading.python_form import SWITCHES, in_python
from tissuq.studies.answers import READING

STRETCH = np.linspace(1, 1.3, 20)
STRESS = 20 * (STRETCH - STRETCH**-2)
VALUES = {"column": "stress=NAME", "only": "'Specimen=S 1'", "stretch": "1:1.2", "axial-stretch": "1.5", "mean-of": "6"}
REFUSED = {
    "columns without names": ({"a": STRETCH, "b": STRESS}, {}, 'stress="NAME"'),
    "forces": ({"stretch": STRETCH, "Force [N]": STRESS}, {}, 'area="10 mm2"'),
    "displacements": ({"u [mm]": STRETCH - 1, "Force [N]": STRESS}, {"area": "6 mm2"}, 'length="20 mm"'),
    "percent": ({"strain": 100 * (STRETCH - 1), "stress [kPa]": STRESS}, {}, 'strain_unit="%"'),
    "signs": ({"strain": 1 - STRETCH, "stress [kPa]": STRESS}, {}, "compression_positive=True"),
    "a modulus": ({"stretch": STRETCH, "Young's modulus [kPa]": STRESS}, {}, 'stress="Young\'s modulus [kPa]"'),
    "a tube": ({"pressure [kPa]": STRESS, "diameter [mm]": STRETCH}, {}, 'mode="planar", diameter="3 mm"'),
    "two tests": (
        {"specimen": ["a"] * 10 + ["b"] * 10, "stretch": STRETCH, "stress [kPa]": STRESS}, {},
        'only={"specimen": "a"}',
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_of_a_table_proposes_arguments(name):
    table, options, proposed = REFUSED[name]
    frame = pd.DataFrame(table)
    with pytest.raises(tq.InputError) as refusal:
        tq.read(frame, **options)
    assert proposed in str(refusal.value)
    assert "--" not in str(refusal.value)
    if name == "columns without names":
        with pytest.raises(tq.InputError, match='stress="NAME"'):
            tq.fit(frame)


@pytest.mark.parametrize("option", READING)
def test_every_option_of_reading_is_an_argument_of_python(option):
    value = "" if option in SWITCHES else VALUES.get(option, "3")
    arguments = eval(f"dict({in_python(f'--{option} {value}'.strip())})")
    assert spelled_out(arguments, READING_OPTIONS)


def test_warnings_and_notes_in_python_propose_arguments():
    turned = np.r_[STRETCH, STRETCH[::-1], STRETCH]
    with pytest.warns(UserWarning, match='stress_unit="kPa", or stress_unit="MPa"'):
        tq.read({"stretch": STRETCH, "stress": STRESS})
    seen = tq.inspect(pd.DataFrame({"stretch": turned, "stress [kPa]": 20 * (turned - turned**-2)}))
    assert 'cycle="last"' in str(seen)
    assert not any("--" in text for text in (str(seen), *seen.warnings))


def test_commands_and_sentences_stay_as_they_are():
    text = (
        "tissuq population FILE --specimen-column 'Protocol' fits each; 1--2 is none. Give --zero, or --branch loading."
    )
    assert in_python(text) == text.replace("--zero", "zero").replace("--branch loading", 'branch="loading"')
