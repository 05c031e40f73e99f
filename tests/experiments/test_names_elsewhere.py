"""Names of columns that do not stand over each of them, and tables between vertical bars."""

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError
from written_files import check_curve, text_file

STRETCH = np.linspace(1, 1.4, 20)
STRAIN, STRESS = 100 * (STRETCH - 1), 1e3 * neo_hookean(STRETCH)


def table(separator, *columns):
    return "\n".join(separator.join(cells) for cells in zip(*columns, strict=True)) + "\n"


def texts(values):
    return [f"{value:.6f}" for value in values]


def check(path):
    data = tq.read(path)
    check_curve(data, STRETCH, 1e-3 * STRESS, atol=1e-8)


NUMBERS = [f'"{number}"' for number in range(1, len(STRETCH) + 1)]
FILES = {
    "R, blanks": '"Strain_%" "Stress_kPa"\n' + table(" ", NUMBERS, texts(STRAIN), texts(STRESS)),
    "R, semicolons": '"Strain_%";"Stress_kPa"\n' + table(";", NUMBERS, texts(STRAIN), texts(STRESS)),
    "R, tabs": "Strain_%\tStress_kPa\n" + table("\t", NUMBERS, texts(STRAIN), texts(STRESS)),
    "thermal analyser": "Instrument\tDMA Q800 V21.1\nSize\t 20.0\t 5.0\t 2.0\tmm (L x W x T)\nNsig\t3\n"
    "Sig1\tTime (min)\nSig2\tStrain (%)\nSig3\tStress (kPa)\nOrgFile\tC:\\TA\\x.001\nStartOfData\n"
    + table("\t", texts(STRETCH), texts(STRAIN), texts(STRESS)),
    "comments": "# column 1: Strain (%)\n# column 2: Stress (kPa)\n" + table(" ", texts(STRAIN), texts(STRESS)),
    "Origin": "A\tB\nStrain\tStress\n%\tkPa\nspecimen 1\tspecimen 1\n" + table("\t", texts(STRAIN), texts(STRESS)),
    "DIAdem": "Name;Time;Strain;Stress\nUnit;s;%;kPa\nDescription;;LVDT;load cell\n"
    + table(";", [""] * 20, texts(STRETCH), texts(STRAIN), texts(STRESS)),
    "vertical bars": "Strain (%)|Stress (kPa)|Time (s)\n" + table("|", texts(STRAIN), texts(STRESS), texts(STRETCH)),
    "Markdown": "| Strain (%) | Stress (kPa) |\n|--------|-------:|\n"
    + table("", ["| "] * 20, texts(STRAIN), [" | "] * 20, texts(STRESS), [" |"] * 20),
}


@pytest.mark.parametrize("kind", FILES)
def test_columns_are_known_by_names_wherever_they_stand(tmp_path, kind):
    path = text_file(tmp_path / "test.txt", FILES[kind])
    check(path)


@pytest.mark.parametrize(
    "head",
    ["strain stress_kPa", "Sig1\tStrain (%)\nSig2\tStress (kPa)"],
)
def test_names_that_may_be_those_of_other_columns_are_not_taken(tmp_path, head):
    separator = "\t" if "\t" in head else " "
    path = text_file(tmp_path / "test.txt", f"{head}\n{table(separator, texts(STRAIN), texts(STRESS), texts(STRETCH))}")
    with pytest.raises(InputError, match=r"columns have no names|has 3 cells, but line 2 with the column names has 2"):
        tq.read(path)
