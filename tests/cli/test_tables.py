import pytest

from tissuq.report.terminal import print_rows


@pytest.mark.parametrize("columns", ["40", "80"])
def test_no_cell_of_a_wide_table_is_cut_short_in_a_narrow_terminal(capsys, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    cells = ["mooney-rivlin", *(f"{number:.6f}" for number in range(10, 22))]
    print_rows("A title", [f"heading {number}" for number in range(13)], [cells])
    said = capsys.readouterr().out
    assert "…" not in said
    assert max(len(line.rstrip()) for line in said.splitlines()) <= 96
    found = [line.split() for line in said.splitlines() if line.strip().startswith("mooney-rivlin")]
    assert len(found) > 1
    assert [cell for line in found for cell in line[1:]] == cells[1:]  # beneath one another, each with its name


def test_cells_of_prose_are_wrapped(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    prose = " ".join(f"word{number}" for number in range(60))
    print_rows("A title", ["claim", "of 2", "numbers"], [["a claim of " + "many " * 15, "2 of 2", prose]])
    said = capsys.readouterr().out
    assert max(len(line.rstrip()) for line in said.splitlines()) <= 96
    assert all(word in said.split() for word in prose.split())


def test_a_title_stands_above_a_table_whose_numbers_end_in_one_column(capsys):
    print_rows("A title", ["name", "value"], [["one", "1.0"], ["two", "100.0"]])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == "A title"
    one, two = (next(line for line in lines if name in line) for name in ("one", "two"))
    assert one.rindex("1.0") + len("1.0") == two.rindex("100.0") + len("100.0")


def test_brackets_and_colons_in_a_name_are_shown_as_they_are(capsys):
    print_rows("[red]x.csv", ["[b]name", "C10"], [["[blue]a :smile:", "1.0"]])
    shown = capsys.readouterr().out
    assert all(text in shown for text in ("[red]x.csv", "[b]name", "[blue]a :smile:"))


def test_columns_beneath_others_stand_beside_all_that_tells_the_rows_apart(capsys):
    rows = [["auto", mode, *["1" * 20] * 5] for mode in ("uniaxial", "planar")]
    print_rows("A title", ["discrepancy", "mode", *(f"number {number}" for number in range(5))], rows)
    said = capsys.readouterr().out
    assert said.count("number 0") == 1
    assert said.count("uniaxial") == said.count("planar") == said.count("discrepancy") == 2
