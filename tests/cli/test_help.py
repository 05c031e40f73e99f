import json
import os
import signal
import subprocess
import sys
from importlib.metadata import version

import pytest
import typer

from tissuq.cli.app import app
from tissuq.cli.command import FORMER_NAMES

HEAVY = ["numpy", "jax", "pandas", "xarray", "matplotlib", "scipy", "pint", "openpyxl"]


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
        "structure",
        "ensemble",
    ],
)
def test_every_command_has_help(cli, name):
    said = cli(name, "--help")
    assert (said.status, said.err) == (0, "")
    assert f"Usage: tissuq {name}" in said.out


def test_the_former_name_of_structure_still_runs_it_and_is_not_listed(cli, done):
    said = done("simulate", "--help")
    assert "Usage: tissuq simulate" in said.out
    assert "It is 'tissuq structure' now" in " ".join(said.out.split())
    assert "simulate" not in cli("--help").out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["papr"], ["No such command", "papr"]),
        (["paper", "--pionts", "12"], ["No such option", "--pionts"]),
        (["paper", "--measurements", "many"], ["tissuq: --measurements needs a whole number, not 'many'."]),
        (["fit", "a.csv", "--axial-stretch", "1,2"], ["tissuq: --axial-stretch needs a number, with a decimal point"]),
        (["paper", "--measurements"], ["--measurements", "requires an argument"]),
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


def test_output_that_nobody_reads_any_more_ends_the_command_without_a_word():
    for name in ("materials", "modes"):
        program = [sys.executable, "-c", "from tissuq.cli import main; main()", name]
        command = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        command.stdout.close()
        assert command.stderr.read() == b""
        assert command.wait() == 141


def test_ctrl_c_ends_with_status_130_and_leaves_nothing(cli, here, specimen, monkeypatch):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("tissuq.report.writer.write_page", interrupt)
    said = cli("fit", specimen, "--discrepancy", "none", "--no-figures")
    assert said.status == 130
    assert said.err == (
        "tissuq: stopped during 'writing' (done: none, assessing); no run was written. "
        f"To begin again: tissuq fit {specimen} --discrepancy none --no-figures\n"
    )
    assert [path.name for path in here.iterdir()] == [specimen.name]


def test_the_version_is_that_of_the_installed_package(cli):
    said = cli("--version")
    assert (said.status, said.out) == (0, f"tissuq {version('tissuq')}\n")


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_a_request_to_terminate_ends_with_status_143_and_leaves_nothing(cli, here, specimen, monkeypatch):
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr("tissuq.report.writer.write_page", lambda *_, **__: os.kill(os.getpid(), signal.SIGTERM))
    try:
        said = cli("fit", specimen, "--discrepancy", "none", "--no-figures")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert said.status == 143
    assert said.err.startswith("tissuq: stopped during 'writing' (done: none, assessing); no run was written. ")
    assert [path.name for path in here.iterdir()] == [specimen.name]


def test_a_terminal_that_shows_ascii_only_shows_question_marks():
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [sys.executable, "-m", "tissuq", "materials"]
    said = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert (said.returncode, said.stderr) == (0, "")
    assert "?" in said.stdout
    assert said.stdout.isascii()


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_ctrl_c_while_modules_are_loaded_is_no_traceback():
    code = (
        "import sys, os, signal\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'tissuq.cli.study':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "sys.argv = ['tissuq', '--help']\n"
        "from tissuq.__main__ import main\n"
        "main()"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (said.returncode, said.stdout, said.stderr) == (130, "", "")


def commands(command=None, path=()):
    """Yield every command with its words."""
    command = command or typer.main.get_command(app)
    for name, part in getattr(command, "commands", {}).items():
        yield from commands(part, (*path, name))
    if not hasattr(command, "commands"):
        yield path, command


def options_of(command):
    return {option for parameter in command.params for option in parameter.opts if option.startswith("--")}


def test_every_former_name_stands_for_an_option_of_today_and_is_none_itself():
    by_name = {path[-1]: options_of(command) for path, command in commands()}
    for name, renamed in FORMER_NAMES.items():
        assert set(renamed.values()) <= by_name[name], name
        assert not set(renamed) & by_name[name], name


MEANINGS = {
    "--abaqus": "the program that opens .odb files",
    "--config": "the file of settings",
    "--discrepancy": "a discrepancy: of a fit to come, or of a run that has several",
    "--draws": "a number of draws from the posterior",
    "--estimand": "what intervals are of, which says which errors of a test they include",
    "--force": "whether what is there may be replaced",
    "--format": "a format of material cards",
    "--full-runs": "how many draws are computed in full",
    "--keep": "whether the files of a solver are kept",
    "--law": "the law of material cards",
    "--markdown": "whether a page of the documentation is printed",
    "--material": "a law of the material",
    "--max-jobs": "how many runs of a solver go on at a time",
    "--measurements": "how many measurements a test has",
    "--method": "how a posterior is computed",
    "--mode": "a loading mode",
    "--noise": "the kind of the noise",
    "--noise-sd": "the standard deviation of the noise, or unknown",
    "--out": "the folder that is written",
    "--prior": "the prior of a parameter",
    "--qoi": "a quantity of a finite-element model",
    "--replace": "the material of a deck whose card is replaced",
    "--replicates": "how many data sets are made of each kind",
    "--retries": "how often a failed run of a solver is made again",
    "--seed": "the seed of random numbers",
    "--sheet": "a sheet of a workbook",
    "--steps": "at how many steps a force is computed",
    "--timeout": "after how many seconds a run of a solver is stopped",
    "--tolerance": "the size of an error of a test",
    "--unit": "the unit of stress of a finite-element model",
    "--workers": "a number of processes",
}
"""What an option is in every command that has it, where its help is not the same in all: written by a person."""


def test_an_option_has_one_meaning_wherever_it_stands():
    helps = {}
    for _, part in commands():
        for parameter in part.params:
            for option in set(parameter.opts) & options_of(part):
                helps.setdefault(option, set()).add(parameter.help)
    assert {option for option, texts in helps.items() if len(texts) > 1} <= {*MEANINGS}


def test_an_option_under_its_former_name_is_the_same(cli):
    today = cli("design", "no-run", "--measurements", "no-number")
    former = cli("design", "no-run", "--points=no-number")
    assert today.status == former.status == 2
    assert former.err == today.err
    assert "--measurements" in today.err


def test_a_warning_of_another_package_is_one_sentence(tmp_path):
    package = tmp_path / "broken-1.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Name: broken\nVersion: 1\n")
    (package / "entry_points.txt").write_text("[tissuq.modes]\nbroken = no_such_module:Mode\n")
    said = subprocess.run(
        [sys.executable, "-c", "from tissuq.cli import main; main()", "modes"],
        env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=True,
    ).stderr  # fmt: skip
    assert said.startswith("tissuq: 'broken' of another package")
    assert said.count("\n") == 1
