import json
import subprocess
import sys

import pytest

HEAVY = ["jax", "pandas", "xarray", "matplotlib", "scipy", "pint", "openpyxl"]


def test_help_is_shown_without_importing_a_heavy_library():
    code = (
        "import json, sys\n"
        "from tissuq.cli import main\n"
        "sys.argv = ['tissuq', '--help']\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n    status = end.code\n"
        f"print(json.dumps([status, [name for name in {HEAVY} if name in sys.modules]]))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "paper" in said
    assert json.loads(said.splitlines()[-1]) == [0, []]


@pytest.mark.parametrize(
    "name",
    [
        "paper",
        "fit",
        "inspect",
        "predict",
        "population",
        "calibrate",
        "design",
        "show",
        "materials",
        "modes",
        "discrepancies",
        "datasets",
        "study",
        "export",
        "simulate",
    ],
)
def test_every_command_has_help(cli, name):
    said = cli(name, "--help")
    assert (said.status, said.err) == (0, "")
    assert f"Usage: tissuq {name}" in said.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["papr"], ["No such command", "papr"]),
        (["paper", "--pionts", "12"], ["No such option", "--pionts"]),
        (["paper", "--points", "many"], ["--points", "integer"]),
        (["paper", "--points"], ["--points", "requires an argument"]),
        (["paper", "stray.csv"], ["stray.csv"]),
        (["show"], ["Missing argument"]),
    ],
)
def test_a_usage_error_ends_with_status_2_and_names_what_is_wrong(cli, here, arguments, words):
    said = cli(*arguments)
    assert said.status == 2
    assert "Traceback" not in said.err
    assert all(word in said.err for word in words)
    assert not list(here.iterdir())


def test_ctrl_c_ends_with_status_130_and_leaves_nothing(cli, here, specimen, monkeypatch):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("tissuq.report.specimen.write_tables", interrupt)
    said = cli("fit", specimen, "--discrepancy", "none", "--no-figures")
    assert said.status == 130
    assert said.err == "tissuq: stopped; no run was written (a campaign goes on with the same command).\n"
    assert [path.name for path in here.iterdir()] == [specimen.name]
