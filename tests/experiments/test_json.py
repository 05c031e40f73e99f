"""Tables in files of JSON, in all forms in which data frames and programs write them."""

import json

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.errors import InputError

STRAIN = [0.0, 0.1, 0.2, 0.3]
STRESS = [0.0, 2.5, 5.5, 9.0]
FRAME = pd.DataFrame({"strain": STRAIN, "stress (kPa)": STRESS})


def read(folder, text):
    file = folder / "test.json"
    file.write_text(text, encoding="utf-8")
    return tq.read(file)


@pytest.mark.parametrize("orient", ["records", "columns", "split", "index", "table"])
def test_data_frames_are_read_as_they_are_written(tmp_path, orient):
    data = read(tmp_path, FRAME.to_json(orient=orient))
    np.testing.assert_allclose(data.stretch, np.add(1, STRAIN))
    np.testing.assert_allclose(data.stress, np.multiply(1e-3, STRESS))


@pytest.mark.parametrize(
    "content",
    [
        {"strain": STRAIN, "stress (kPa)": STRESS, "specimen": "A1", "modes": ["pull"]},
        {"operator": "NN", "data": {"strain": STRAIN, "stress (kPa)": STRESS}},
        [["strain", "stress (kPa)"], *map(list, zip(STRAIN, STRESS, strict=True))],
        {"results": [{"strain": a, "stress (kPa)": b} for a, b in zip(STRAIN, STRESS, strict=True)]},
    ],
)
def test_lists_and_rows_are_a_table_wherever_they_stand(tmp_path, content):
    data = read(tmp_path, json.dumps(content))
    np.testing.assert_allclose(data.stress, np.multiply(1e-3, STRESS))


def test_a_missing_value_is_refused_as_an_empty_cell(tmp_path):
    rows = [{"strain": a, "stress (kPa)": b} for a, b in zip(STRAIN, STRESS, strict=True)]
    del rows[1]["stress (kPa)"]
    with pytest.raises(InputError, match=r"line 3, column 'stress .*the cell is empty"):
        read(tmp_path, json.dumps(rows))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"specimen": "A1"}', "JSON without a table that is known: write lists of one length"),
        ('{"strain": [0, 1', "seems to be a JSON file, but it cannot be opened"),
        ("[]", "JSON without a table"),
    ],
)
def test_what_holds_no_table_is_refused_with_what_to_write(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        read(tmp_path, text)
