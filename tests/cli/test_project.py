import os
import shutil
import sys
from importlib import metadata
from pathlib import Path

import pytest

from tissuq import datasets
from tissuq.studies import installation


def test_the_example_project_is_written_and_what_to_type_next_is_said(cli, here):
    said = cli("init", "brain")
    assert (said.status, said.err) == (0, "")
    assert "tissuq fit study.toml" in said.out
    files = sorted(path.relative_to(here / "brain").as_posix() for path in (here / "brain").rglob("*.*"))
    assert files == ["README.md", "analysis.py", "data/shear.csv", "data/tension-compression.csv", "study.toml"]
    assert (here / "brain/data/shear.csv").read_bytes() == datasets.path("brain-cortex-shear").read_bytes()


def test_without_a_name_the_folder_is_tissuq_example(done, here):
    done("init")
    assert [path.name for path in here.iterdir()] == ["tissuq-example"]


def test_an_empty_folder_is_written_into(done, here):
    (here / "mine").mkdir()
    done("init", "mine")
    assert (here / "mine" / "study.toml").exists()


@pytest.mark.parametrize("place", ["folder", "file"])
def test_what_is_there_is_left_alone(refused, here, place):
    (here / "folder").mkdir()
    (here / "folder" / "mine.txt").write_text("mine")
    (here / "file").write_text("mine")
    refused([f"'{place}'", "tissuq init FOLDER"], "init", place)
    assert [path.name for path in (here / "folder").iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("is_there", [True, False])
def test_a_project_that_cannot_be_finished_leaves_nothing(refused, here, monkeypatch, is_there):
    if is_there:
        (here / "brain").mkdir()

    def full(*arguments, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    refused(["No space left"], "init", "brain")
    assert [path for path in here.rglob("*") if path != here / "brain"] == []
    assert (here / "brain").exists() == is_there


def test_the_commands_of_the_example_work(cli, done, here, monkeypatch):
    cli("init", "brain")
    monkeypatch.chdir(here / "brain")
    done("inspect", "data/tension-compression.csv")
    said = done("fit", "study.toml", "--discrepancy", "none", "--no-figures")
    assert "Each test predicted from the others" in said.out


@pytest.mark.slow
def test_the_script_of_the_example_runs(cli, here, monkeypatch, capsys):
    import runpy

    cli("init", "brain")
    monkeypatch.chdir(here / "brain")
    runpy.run_path("analysis.py")
    assert "initial shear modulus: 0.96 to 1.74 kPa" in capsys.readouterr().out
    assert Path("posterior.nc").exists()


def test_the_doctor_names_versions_extras_and_programs(cli):
    said = cli("doctor")
    assert (said.status, said.err) == (0, "")
    lines = [line.split() for line in said.out.splitlines()]
    for package in ("numpy", "jax", "scipy"):
        assert [package, metadata.version(package)] in lines
    assert all(name in said.out for name in [*installation.EXTRAS, *installation.PROGRAMS])


def test_the_doctor_finds_a_program_on_the_path(cli, here, monkeypatch):
    program = here / "febio4"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(here), prepend=os.pathsep)
    lines = cli("doctor").out.splitlines()
    place = next(number for number, line in enumerate(lines) if line.split()[:1] == ["FEBio"])
    assert lines[place + 1].strip() == shutil.which("febio4") == str(program)


def test_the_doctor_says_what_to_install(cli, monkeypatch):
    found = metadata.version

    def version(name):
        if name == "felupe":
            raise metadata.PackageNotFoundError(name)
        return "1.9" if name == "numpy" else found(name)

    monkeypatch.setattr(metadata, "version", version)
    said = cli("doctor")
    assert said.status == 2
    assert "pip install 'tissuq[fe]'" in said.out
    assert "pip install --upgrade 'numpy>=2.0'" in said.err


def test_every_extra_has_a_purpose(cli):
    import tomllib

    text = (Path(installation.__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8")
    extras = set(tomllib.loads(text)["project"]["optional-dependencies"])
    assert extras == set(installation.EXTRAS) | set(installation.DEVELOPER_EXTRAS)


@pytest.mark.parametrize(
    ("version", "least", "is_enough"),
    [
        ("2.10", "2.9", True),
        ("2.9", "2.10", False),
        ("2.0.0", "2.0", True),
        ("1.2rc1", "1.2", True),
        ("2026.8.0", "2025.1", True),
        (None, "0", False),
    ],
)
def test_versions_are_compared_by_their_numbers(version, least, is_enough):
    assert installation.Package("a", version, least).is_enough == is_enough


def test_the_formats_of_cards_are_those_that_programs_are_named_for():
    from tissuq.export.code import FECode
    from tissuq.registry import variants

    purposes = " ".join(purpose for _, purpose in installation.PROGRAMS.values())
    named = {words.split()[0].rstrip(";") for words in purposes.split("--format ")[1:]}
    assert named == set(variants(FECode))


def test_completion_offers_the_commands(cli, monkeypatch):
    monkeypatch.setenv("_TISSUQ_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "tissuq do")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert cli().out.split() == ["doctor"]
    assert sys.argv == ["tissuq"]
