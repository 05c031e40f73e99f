"""A result is written, read, printed and shown the same way, whatever command it comes from."""

from __future__ import annotations

import csv
import json
import re
from html import unescape
from importlib.metadata import version
from math import inf, nan
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure
from pydantic import BaseModel

from tissuq.assessment.uses import Use, Verdict
from tissuq.errors import InputError
from tissuq.report.result import Number, Picture, Preformatted, Result, Section, Table, few_and_others
from tissuq.report.terminal import print_result
from tissuq.report.writer import contents_for_programs, read_record, write_result
from tissuq.result_warning import ResultWarning, Severity


class Settings(BaseModel):
    file: str = "a.csv"


def warnings_of(*severities):
    return tuple(ResultWarning(f"warning {n}", severity=severity) for n, severity in enumerate(severities))


def result_of(**changes):
    arguments = {
        "command": "design --option",
        "title": "Title <b>",
        "subject": "subject & co",
        "numbers": (Number("modulus", 81.34, 79.02, 83.71, "kPa"), Number("best test", "planar", remark="by far")),
        "finding": "**Strong** and `code` and <i>.",
        "uses": (Use("report it", Verdict.CARE, "known to ± 3 %"),),
        "next_step": "type tissuq design {run}",
        "picture": Picture("answer", Figure, "words", "caption"),
        "tables": (Table(["name", "value"], [["a", "1"]], "Main table", note="Of `all`."),),
        "sections": (
            Section("Folded", ("A paragraph.", ("first", "second"), Picture("more", Figure, "alt", "caption 2"),
                               Section("Deeper", (Preformatted("<pre>"), Table(["x"], [["deep"]]))))),
        ),
        "recipe": Settings(),
    }  # fmt: skip
    return Result(**arguments | changes)


@pytest.mark.parametrize(
    ("number", "text", "beside"),
    [
        (Number("x", 81.34, 79.02, 83.71, "kPa"), "81.3 kPa", "95 % interval 79.0 to 83.7"),
        (Number("x", 0.5), "0.5", ""),
        (Number("x", "planar", remark="by far"), "planar", "by far"),
        (Number("x", 6.1e-05, 2.3e-05, 1.1e-04, "MPa"), "0.000061 MPa", "95 % interval 0.000023 to 0.000110"),
        (Number("x", 6.1e-05, 5.0e-05, 7.1e-05, "MPa"), "6.10e-05 MPa", "95 % interval 5.00e-05 to 7.10e-05"),
        (Number("x", 1.0, 1.0, 1.0, "MPa", "95 % band"), "1 MPa", "95 % band 1 to 1"),
        (Number("x", 404.0, 15.0, 3e21, "kPa"), "404 kPa", "95 % interval 15 to 3e+21"),
        (Number("x", 404.0, 15.0, inf, "kPa"), "404 kPa", "95 % interval 15 to inf"),
        (Number("x", nan, nan, nan, "kPa"), "not known", ""),
    ],
)
def test_a_number_is_rounded_by_the_width_of_its_interval(number, text, beside):
    assert (number.text, number.beside) == (text, beside)


def test_what_is_not_finite_is_null_for_programs(tmp_path):
    write_result(result_of(numbers=(Number("x", 1.0, -inf, inf), Number("y", nan))), tmp_path)
    first, second = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["numbers"]
    assert (first["value"], first["low"], first["high"]) == (1.0, None, None)
    assert (second["value"], second["text"]) == (None, "not known")


def test_at_most_three_warnings_are_shown_the_severest_first_and_notes_are_folded():
    caution, note, problem = Severity.CAUTION, Severity.NOTE, Severity.PROBLEM
    record = result_of(warnings=warnings_of(note, caution, caution, problem, caution)).record()
    shown, others = few_and_others(record)
    assert [warning["text"] for warning in shown] == ["warning 3", "warning 1", "warning 2"]
    assert [warning["text"] for warning in others] == ["warning 4", "warning 0"]
    assert few_and_others(result_of(uses=(), warnings=warnings_of(note)).record())[0] == []


def test_every_problem_is_shown():
    shown, others = few_and_others(result_of(warnings=warnings_of(*[Severity.PROBLEM] * 5, Severity.CAUTION)).record())
    assert (len(shown), len(others)) == (5, 1)


@pytest.mark.parametrize(("verdict", "count"), [(Verdict.YES, 0), (Verdict.CARE, 1), (Verdict.NO, 1)])
def test_a_note_is_shown_where_the_first_use_is_in_doubt(verdict, count):
    uses = (Use("report it", verdict, "known to ± 15 %"), Use("predict", Verdict.YES, "known"))
    shown, others = few_and_others(result_of(uses=uses, warnings=warnings_of(Severity.NOTE)).record())
    assert (len(shown), len(others)) == (count, 1 - count)


def test_every_kind_of_content_is_written(tmp_path):
    rows = [{"a": 1, "b": None}, {"a": 2.5, "b": "x"}]
    (tmp_path / "source.txt").write_text("copied")
    folder = tmp_path / "run"
    folder.mkdir()
    files = {
        "rows.csv": rows,
        "rows.json": rows,
        "table.csv": pd.DataFrame({"a": [0.5]}, index=["left out"]),
        "text.txt": "text",
        "bytes.bin": b"\x00",
        "input/copy.txt": tmp_path / "source.txt",
        "deep/function.txt": lambda path: path.write_text("by function"),
    }
    write_result(result_of(files=files, picture=None, sections=()), folder)
    with (folder / "rows.csv").open(newline="") as lines:
        assert list(csv.DictReader(lines)) == [{"a": "1", "b": ""}, {"a": "2.5", "b": "x"}]
    assert json.loads((folder / "rows.json").read_text()) == rows
    texts = [(folder / name).read_bytes() for name in list(files)[2:]]
    assert texts == [b"a\n0.5\n", b"text", b"\x00", b"copied", b"by function"]
    assert not (folder / "figures").exists()


def test_the_recipe_says_the_command_and_that_there_are_no_figures(tmp_path):
    write_result(result_of(), tmp_path, figures=False)
    recipe = (tmp_path / "run.toml").read_text()
    assert f"(version {version('tissuq')}): tissuq design --no-figures --option --config run.toml" in recipe
    assert "tissuq design --no-figures --option --config run.toml" in (tmp_path / "report.html").read_text()
    assert not (tmp_path / "figures").exists()
    assert "<img" not in (tmp_path / "report.html").read_text()


def test_figures_of_an_earlier_run_go(tmp_path):
    write_result(result_of(), tmp_path)
    assert {path.name for path in (tmp_path / "figures").glob("*.svg")} == {"answer.svg", "more.svg"}
    write_result(result_of(sections=()), tmp_path)
    assert {path.name for path in (tmp_path / "figures").glob("*.svg")} == {"answer.svg"}


def test_the_page_begins_with_the_answer_and_escapes_what_it_is_given(tmp_path):
    write_result(result_of(warnings=warnings_of(*[Severity.CAUTION] * 5)), tmp_path)
    page = (tmp_path / "report.html").read_text()
    body = page[page.index("<main>") :]
    assert body.index("81.3\u00a0kPa") < body.index("Next:") < body.index("<img") < body.index('class="warning ')
    assert len(re.sub(r"<[^>]*>", " ", body[: body.index("<img")]).split()) < 60
    assert "Title &lt;b&gt;" in body
    assert "<strong>Strong</strong> and <code>code</code> and &lt;i&gt;." in body
    assert "&lt;pre&gt;" in body
    unfolded = re.sub(r"<details.*?</details>", "", body, flags=re.DOTALL)
    assert unfolded.count('class="warning ') == 3
    assert "Further warnings and notes: 2" in body
    assert unfolded.count('<strong class="kind">First warning</strong>') == 1
    assert unfolded.count('<strong class="kind">Warning</strong>') == 2


def test_the_record_of_a_folder_is_that_of_the_result(tmp_path):
    with pytest.raises(InputError, match=r"not the folder of a complete run: result\.json is missing"):
        read_record(tmp_path)
    result = result_of(warnings=warnings_of(Severity.NOTE))
    write_result(result, tmp_path, figures=False)
    assert read_record(tmp_path) == json.loads(json.dumps(result.record()))


def test_a_folder_without_a_record_says_what_it_holds_instead(tmp_path):
    for name in ("liver", "my kidney"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        write_result(result_of(), tmp_path / "runs" / name, figures=False)
    with pytest.raises(InputError, match=r"Runs in it: \S*/runs/liver, '.*/runs/my kidney'\."):
        read_record(tmp_path / "runs")
    for name in ("run.toml", "tasks.jsonl"):
        (tmp_path / name).write_text("")
    with pytest.raises(InputError, match=r"It was stopped: the command that began it, with --out .*, goes on"):
        read_record(tmp_path)


@pytest.mark.parametrize("content", ["", "[]", "{}", "null", '{"title": 1}', "[" * 100_000, "9" * 5000])
def test_a_damaged_record_is_one_message(tmp_path, content):
    (tmp_path / "result.json").write_text(content)
    with pytest.raises(InputError, match="damaged"):
        read_record(tmp_path)


@pytest.mark.parametrize("part", ["numbers", "tables", "sections", "warnings", "uses", "next"])
def test_a_record_whose_parts_are_something_else_is_damaged(tmp_path, part):
    record = result_of().record() | {part: [3]}
    (tmp_path / "result.json").write_text(json.dumps(record))
    with pytest.raises(InputError, match="damaged"):
        read_record(tmp_path)


def test_the_next_step_on_a_page_names_the_folder_as_the_terminal_does(tmp_path):
    write_result(result_of(), tmp_path, target=Path("runs", "my run"))
    assert "type tissuq design &#39;runs/my run&#39;" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_programs_get_every_json_file_with_the_folder_in_the_next_step(tmp_path):
    with pytest.raises(InputError, match="not the folder of a complete run"):
        contents_for_programs(tmp_path)
    write_result(result_of(files={"rows.json": [{"a": 1}]}), tmp_path, figures=False)
    contents = contents_for_programs(tmp_path)
    assert contents["rows"] == [{"a": 1}]
    assert contents["result"]["next"] == f"type tissuq design {tmp_path}"


def test_the_terminal_says_the_answer_first_and_counts_the_rest(tmp_path, capsys):
    record = result_of(warnings=warnings_of(*[Severity.CAUTION] * 5)).record()
    print_result(record, tmp_path)
    out = capsys.readouterr().out
    words = [
        "81.3 kPa, 95 % interval",
        "Strong and code",
        "WITH CARE",
        "Next: type",
        "Main table",
        "Of all.",
        "warning 2",
    ]
    assert [out.index(word) for word in words] == sorted(out.index(word) for word in words)
    assert "warning 3" not in out
    assert "A paragraph" not in out
    joined = " ".join(out.split())
    assert "Folded; further warnings and notes (2): tissuq show" in joined
    assert out.endswith(f"Report: {tmp_path / 'report.html'}\n")


def test_the_terminal_says_beneath_the_title_what_was_measured(capsys):
    record = result_of().record()
    print_result(record)
    assert capsys.readouterr().out.splitlines()[1:3] == [record["title"], f"  {record['subject']}"]


def test_the_terminal_calls_a_note_a_note(capsys):
    print_result(result_of(warnings=warnings_of(Severity.CAUTION, Severity.NOTE)).record())
    out = capsys.readouterr().out
    assert "Warning: warning 0" in out
    assert "Note: warning 1" in out


def test_long_numbers_are_wrapped_in_the_terminal(capsys):
    print_result(result_of(numbers=(Number("the best", "a test of a long name " * 8),)).record())
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 96
    first = next(number for number, line in enumerate(lines) if "the best" in line)
    assert lines[first + 1].startswith(" " * len("  the best  ") + "name a test")


def test_an_interval_is_in_one_line_in_the_terminal(capsys):
    print_result(result_of(numbers=(Number("the modulus " * 4, 6.1e-05, 2.3e-05, 1.1e-04, "MPa"),)).record())
    assert [line.strip() for line in capsys.readouterr().out.splitlines()][4] == "95 % interval 0.000023 to 0.000110"


def test_no_word_is_cut_beside_a_long_name_in_the_terminal(capsys):
    remark = "all within the measured range of I1 and I2"
    print_result(result_of(numbers=(Number("n" * 66, "0 % of the points", remark=remark),)).record())
    assert remark in " ".join(capsys.readouterr().out.split())


def test_exponents_stay_in_one_piece_on_a_page(tmp_path):
    write_result(result_of(finding="1.4e-05 to 8.6e-05 MPa, not phase-2"), tmp_path, figures=False)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<span class=option>1.4e-05</span> to <span class=option>8.6e-05</span> MPa, not phase-2" in page


def test_options_in_warnings_stay_in_one_piece_on_a_page(tmp_path):
    warning = ResultWarning("give --load-zero first, not <b>a--b</b>", severity=Severity.CAUTION)
    write_result(result_of(warnings=(warning,)), tmp_path, figures=False)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "give <span class=option>--load-zero</span> first, not &lt;b&gt;a--b&lt;/b&gt;" in page


def test_details_leave_nothing_out(tmp_path, capsys):
    record = result_of(warnings=warnings_of(*[Severity.CAUTION] * 5)).record()
    print_result(record, tmp_path, details=True)
    out = capsys.readouterr().out
    for word in ("warning 4", "A paragraph.", "- second", "Deeper", "deep"):
        assert word in out
    assert "--details" not in out


def test_a_problem_stands_above_the_answer(capsys):
    print_result(result_of(warnings=warnings_of(Severity.PROBLEM)).record())
    out = capsys.readouterr().out
    assert out.index("warning 0") < out.index("81.3 kPa")
    assert "Report" not in out


@pytest.mark.parametrize(("verdict", "classes"), [(Verdict.NO, "first doubtful"), (Verdict.CARE, "first")])
def test_a_number_that_is_not_to_be_reported_does_not_stand_out(verdict, classes, tmp_path):
    write_result(result_of(uses=(Use("report it", verdict, "known to ± 90 %"),)), tmp_path, figures=False)
    assert f'<p class="{classes}">' in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_page_has_the_recipe_as_it_is_in_the_file(tmp_path):
    write_result(result_of(recipe=Settings(file="strain of 10 % <b>.csv")), tmp_path, figures=False)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    recipe = (tmp_path / "run.toml").read_text(encoding="utf-8")
    assert recipe in map(unescape, re.findall(r"<pre [^>]*>(.*?)</pre>", page, re.DOTALL))


def test_no_line_ends_before_the_sign_of_a_percentage(capsys):
    for count in range(1, 40):
        print_result(result_of(finding=f"{'x' * count} " + "it is 95 % of it " * 12).record())
    lines = capsys.readouterr().out.splitlines()
    assert any("95 %" in line for line in lines)
    assert not any(line.lstrip().startswith("%") for line in lines)


def test_a_table_of_columns_has_a_cell_of_every_row_in_each():
    rows = [{"mean": 1.5, "name": "a"}, {"mean": 2.0, "name": "b"}]
    table = Table.of(
        rows, {"fit": lambda row: row["name"], "mean": lambda row: f"{row['mean']:.1f}"}, "Fits", note="kPa"
    )
    assert table == Table(["fit", "mean"], [["a", "1.5"], ["b", "2.0"]], "Fits", note="kPa")
