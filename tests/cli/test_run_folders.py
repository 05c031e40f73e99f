"""Nothing is overwritten unasked, nothing foreign is deleted, and a failed run leaves nothing."""

import errno
import os
import re
import shutil
import subprocess
import sys

import pytest

from marks import slow_but
from tissuq import datasets
from tissuq.report.run_folder import check_target, run_folder

from .conftest import tree

ALONE = ["--noise-sd", "1", "--discrepancy", "none", "--no-figures"]


def test_an_existing_run_is_refused_without_force_and_left_as_it_was(refused, done, here, specimen):
    done("fit", specimen, *ALONE)
    before = tree(here)
    refused(["run folder 'runs/specimen' already exists", "--force"], "fit", specimen, *ALONE, "--seed", 9)
    assert tree(here) == before


def test_an_existing_run_is_replaced_with_force(done, here, specimen):
    done("fit", specimen, *ALONE)
    done("fit", specimen, *ALONE, "--seed", 9, "--force")
    assert "seed = 9" in (here / "runs" / "specimen" / "run.toml").read_text()
    assert [path.name for path in (here / "runs").iterdir()] == ["specimen"]


def test_an_empty_folder_is_taken(done, here, specimen):
    (here / "empty").mkdir()
    done("fit", specimen, *ALONE, "--out", "empty")
    assert (here / "empty" / "run.toml").exists()


@pytest.mark.parametrize("force", [[], ["--force"]], ids=["without force", "with force"])
@pytest.mark.parametrize("name", ["thesis.docx", "run.toml", "summary.csv"])
@pytest.mark.parametrize("command", ["fit", "paper"])
def test_a_folder_of_other_files_is_never_touched(refused, here, specimen, command, name, force):
    (here / "mine").mkdir()
    (here / "mine" / name).write_text("mine")
    before = tree(here)
    options = [specimen, *ALONE] if command == "fit" else ["--no-figures"]
    refused(["folder 'mine' contains files that are not a run"], command, *options, "--out", "mine", *force)
    assert tree(here) == before


def test_what_another_command_made_is_not_replaced_with_force(refused, done, here, specimen):
    done("fit", specimen, "--discrepancy", "none", "--no-figures", "--out", "run")
    done("export", "run", "--draws", 2, "--out", "made")
    before = sorted(path.name for path in (here / "made").iterdir())
    for command in (("fit", specimen, "--no-figures"), ("design", "run", "--no-figures")):
        refused(
            [f"holds what tissuq export made, which --force of tissuq {command[0]} does not replace"],
            *command,
            "--out",
            "made",
            "--force",
        )
    assert sorted(path.name for path in (here / "made").iterdir()) == before
    done("export", "run", "--draws", 3, "--out", "made", "--force")


@pytest.mark.parametrize("name", ["notes.txt", "figures/mine.png", "posterior/deep/er/mine.nc"])
def test_files_that_someone_put_into_a_run_folder_are_not_deleted_by_force(refused, done, here, specimen, name):
    done("fit", specimen, *ALONE)
    mine = here / "runs" / "specimen" / name
    mine.parent.mkdir(parents=True, exist_ok=True)
    mine.write_text("mine")
    before = tree(here)
    refused([name], "fit", specimen, *ALONE, "--force")
    assert tree(here) == before


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("specimen.csv", ["'specimen.csv' is a file", "--out"]),
        ("specimen.csv/run", ["'specimen.csv/run' cannot be created", "is a file", "--out"]),
        (".", ["'.' is the current folder", "--out"]),
        ("/proc/no/run", ["'/proc/no/run'", "--out"]),
        ("deep/" + "a" * 300, ["aaa'", "too long", "--out"]),
        ("deep/" + "a" * 250, ["aaa'", "too long", "--out"]),
    ],
    ids=["a file", "under a file", "the current folder", "unwritable", "name too long", "name nearly too long"],
)
def test_a_folder_that_cannot_be_made_is_refused_and_leaves_nothing(refused, specimen, out, words):
    refused(words, "fit", specimen, *ALONE, "--out", out)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_without_permission_is_refused_before_the_work(refused, here, specimen):
    (here / "locked").mkdir(mode=0o555)
    refused(["locked"], "fit", specimen, *ALONE, "--out", "locked/run")


PARTS = "recipe", "csv", "json", "page"
STEPS = [*(f"report.writer.write_{part}" for part in PARTS), "posterior.posterior.Posterior.save"]


def fail_for_want_of_space(*arguments, **options):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("step", STEPS)
def test_a_disk_that_is_full_at_any_step_leaves_nothing(refused, specimen, monkeypatch, step):
    monkeypatch.setattr(f"tissuq.{step}", fail_for_want_of_space)
    message = "the run could not be written to 'new/folder/run': No space left on device"
    refused([message], "fit", specimen, *ALONE, "--out", "new/folder/run")


def test_a_disk_that_is_full_leaves_the_earlier_run_that_was_to_be_replaced(done, refused, specimen, monkeypatch):
    done("fit", specimen, *ALONE)
    monkeypatch.setattr("tissuq.report.writer.write_page", fail_for_want_of_space)
    refused(["No space left on device"], "fit", specimen, *ALONE, "--force")


def test_the_earlier_run_is_put_back_when_the_new_one_cannot_take_its_place(cli, done, here, specimen, monkeypatch):
    done("fit", specimen, *ALONE)
    before = tree(here)
    rename = type(here).rename

    def fail(self, target):
        if str(target).endswith("specimen") and not self.name.endswith("-earlier"):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return rename(self, target)

    monkeypatch.setattr(type(here), "rename", fail)
    said = cli("fit", specimen, *ALONE, "--force", "--seed", 9)
    assert said.status == 2
    assert tree(here) == before


@pytest.mark.slow
@pytest.mark.parametrize("largest_file", slow_but([150_000], [3_000, 150_000]))
def test_a_file_system_that_stops_writing_ends_with_one_message_and_leaves_nothing(here, specimen, largest_file):
    before = tree(here)

    code = (
        "import resource, signal\n"
        "from tissuq.cli import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({largest_file}, {largest_file}))\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", code, "fit", specimen.name, *ALONE],
        cwd=here, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("tissuq: the run could not be written to 'runs/specimen': File too large.")
    assert done.stderr.count("\n") == 1
    assert tree(here) == before


def test_a_full_standard_output_ends_without_a_traceback():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", "from tissuq.cli import main; main()", "materials"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode != 0
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_run_through_a_link_to_a_folder_keeps_the_link(done, here, specimen):
    (here / "real").mkdir()
    (here / "link").symlink_to("real")
    done("fit", specimen, *ALONE, "--out", "link")
    done("fit", specimen, *ALONE, "--out", "link", "--force")
    assert (here / "link").is_symlink()
    assert (here / "real" / "run.toml").exists()


def test_a_run_is_repeated_into_its_own_folder_with_force(done, here):
    done("fit", "rubber-treloar-uniaxial", *ALONE, "--out", "run")
    done("fit", "--config", "run/run.toml", "--no-figures", "--out", "run", "--force")
    copy = here / "run" / "input" / "rubber-treloar-uniaxial.csv"
    assert copy.read_bytes() == datasets.path("rubber-treloar-uniaxial").read_bytes()


NESTED = b"[" * 100_000
HUGE = b"9" * 5000


@pytest.mark.parametrize(
    ("name", "content"),
    [
        *(("result.json", content) for content in
          (b"", b"\xff\xfe", b"null", b"[{}]", NESTED, HUGE, b'[{"formulation": 3, "C10_mean": [1]}]')),
        *((name, content) for name in ("summary.json", "assessment.json") for content in
          (b"", b"\xff\xfe", NESTED, HUGE)),
        *(("run.toml", content) for content in
          (b"\xff\xfe", b"a = " + NESTED, b"a = " + HUGE, b"a.b" * 2000 + b" = 1")),
        pytest.param("run.toml", b"a.b" * 20_000 + b" = 1", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_damaged_file_of_a_run_is_one_message(cli, here, fit_run, name, content):
    folder, _ = fit_run
    shutil.copytree(folder, here / "run")
    (here / "run" / name).write_bytes(content)
    repeat = "fit", "--config", "run/run.toml", "--out", "again"
    show = "show", "run", "--details" if name == "result.json" else "--json"
    said = cli(*(repeat if name == "run.toml" else show))
    assert said.status == 2
    assert said.err.startswith("tissuq: ")
    assert said.err.count("\n") == 1
    assert any(word in said.err for word in ("damaged", "not TOML"))


def test_a_list_of_contents_that_is_no_text_is_no_reason_to_replace_a_run(refused, done, here, specimen):
    options = ("--discrepancy", "none", "--no-figures", "--out", "run")
    done("fit", specimen, *options)
    (here / "run" / "contents.txt").write_bytes(b"\xff\xfe\n")
    refused(["also contains files that do not belong to the run"], "fit", specimen, *options, "--force")


KILLED = """
import os, sys
from pathlib import Path
from tissuq.report.run_folder import run_folder

def write(text, rename=Path.rename):
    with run_folder(Path("out"), "fit", force=True) as folder:
        (folder / "text").write_text(text)
        Path.rename = rename

def killed(path, target):
    os._exit(9)

def killed_between(path, target, rename=Path.rename):
    return rename(path, target) if str(target).endswith("-earlier") else os._exit(9)

def killed_after(path, target, rename=Path.rename):
    rename(path, target)
    if not str(target).endswith("-earlier"):
        os._exit(9)

write("first")
write("second", {"while": killed, "between": killed_between, "after": killed_after}[sys.argv[1]])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="folders have no locks there")
@pytest.mark.parametrize(("moment", "kept"), [("while", "first"), ("between", "first"), ("after", "second")])
def test_what_a_killed_command_left_is_taken_away_by_the_next_and_an_earlier_run_is_put_back(here, moment, kept):
    assert subprocess.run([sys.executable, "-c", KILLED, moment], cwd=here, check=False).returncode == 9
    assert any(path.name.startswith(".out-") for path in here.iterdir())
    foreign = here / ".out-pictures"
    foreign.mkdir()
    check_target(here / "out", "fit", force=True)
    assert {path.name for path in here.iterdir()} == {"out", foreign.name}
    assert (here / "out" / "text").read_text() == kept


def test_what_another_command_is_writing_is_left_alone(here):
    with run_folder(here / "out", "fit") as folder:
        check_target(here / "out", "fit", force=True)
        assert folder.is_dir()
    assert (here / "out").is_dir()


@pytest.mark.parametrize("arguments", [["Pr\udcfcfling.csv"], ["folder"]], ids=["argument", "in a folder"])
def test_a_file_whose_name_is_not_in_utf_8_is_refused_in_words(specimen, here, arguments):
    (here / "folder").mkdir()
    for name in ("Pr\udcfcfling.csv", "folder/Pr\udcfcfling.csv"):
        shutil.copy(specimen, here / name)
    command = [sys.executable, "-m", "tissuq", "fit", *arguments, "--mode", "uniaxial", "--discrepancy", "none"]
    done = subprocess.run(
        [*command, "--no-figures"], cwd=here, capture_output=True, text=True, errors="replace", check=False
    )
    assert done.returncode == 2
    assert re.search("a name is not in UTF-8: .*Pr.fling.csv", done.stderr)
    assert "Traceback" not in done.stderr
