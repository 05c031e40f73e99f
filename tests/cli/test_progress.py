"""How a command gets on: lines where there is no terminal, the log of a run, what is said when it is stopped."""

from __future__ import annotations

import re
import socket
import sys
from pathlib import Path

import pytest

from tissuq.cli import progress
from tissuq.cli.progress import LOG, Monitor


@pytest.fixture(autouse=True)
def lines(monkeypatch):
    """Have lines told, which other tests leave out because they depend on how fast the machine is."""
    monkeypatch.delenv(progress.SWITCH)


ALONE = ("--noise-sd", 1, "--discrepancy", "none", "--no-figures")


class Impatient:
    """A timer that is over as soon as it starts."""

    def __init__(self, seconds, function, arguments):
        self.function, self.arguments = function, arguments

    def start(self):
        self.function(*self.arguments)

    def cancel(self):
        pass


class Endless(Impatient):
    """A timer that is never over."""

    def start(self):
        pass


def carry_out(monitor):
    with monitor.steps(3) as step:
        for name in ("reading", "fitting", "writing"):
            step(name)


def test_a_long_step_is_told_in_a_line_where_there_is_no_terminal(monkeypatch, capsys):
    monkeypatch.setattr(progress, "Timer", Impatient)
    carry_out(Monitor())
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.splitlines() == ["tissuq: 1 of 3: reading", "tissuq: 2 of 3: fitting", "tissuq: 3 of 3: writing"]


class Bar:
    """What a terminal shows beside the bar, text by text."""

    def __init__(self):
        self.texts = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def add_task(self, description, total):
        self.texts.append(description)

    def update(self, task, description, completed):
        self.texts.append(description)


def test_a_terminal_tells_the_time_left_of_tasks_that_are_alike_and_not_of_steps_that_are_not(monkeypatch):
    steps, tasks = Bar(), Bar()
    monkeypatch.setattr(progress, "monotonic", iter(range(0, 10_000, 50)).__next__)
    monkeypatch.setattr(Monitor, "_bar", lambda self, total: steps)
    carry_out(Monitor(is_quiet=True))
    monkeypatch.setattr(Monitor, "_bar", lambda self, total: tasks)
    with Monitor(is_quiet=True).campaign(3) as step:
        for number in range(3):
            step(f"task {number}", True)
    assert steps.texts == ["starting", "reading", "fitting", "writing"]
    assert [re.sub(r"\d+:\d\d left, ", "TIME left, ", text) for text in tasks.texts] == [
        "", *(f"TIME left, task {number}" for number in range(3))
    ]  # fmt: skip


def test_nothing_is_said_of_short_steps_or_in_quiet(monkeypatch, capsys):
    monkeypatch.setattr(progress, "Timer", Endless)
    carry_out(Monitor())
    monkeypatch.setattr(progress, "Timer", Impatient)
    carry_out(Monitor(is_quiet=True, is_verbose=True))
    monkeypatch.setenv(progress.SWITCH, "off")
    carry_out(Monitor())
    assert capsys.readouterr() == ("", "")


def test_a_step_that_ends_in_time_takes_its_line_along(monkeypatch):
    cancelled = []
    monkeypatch.setattr(progress, "Timer", Endless)
    monkeypatch.setattr(Endless, "cancel", lambda timer: cancelled.append(timer.arguments[0]))
    carry_out(Monitor())
    assert [text.rpartition(" ")[2] for text in cancelled] == ["reading", "fitting", "writing"]


def test_it_is_told_once_that_no_task_is_done_and_not_after_the_first(monkeypatch, capsys):
    cancelled = []
    monkeypatch.setattr(progress, "Timer", Endless)
    monkeypatch.setattr(Endless, "cancel", lambda timer: cancelled.append(timer.arguments[0]))
    with Monitor().campaign(4) as step:
        assert cancelled == []
        step("task 0", True)
        assert cancelled == ["none of 4 tasks is done after 60 s"]
    monkeypatch.setattr(progress, "Timer", Impatient)
    with Monitor().campaign(4):
        assert capsys.readouterr().err == "tissuq: none of 4 tasks is done after 60 s\n"


def test_the_time_left_is_that_of_the_tasks_so_far(monkeypatch, capsys):
    clock = iter([0.0, *range(0, 1000, 20)])
    monkeypatch.setattr(progress, "monotonic", lambda: next(clock))
    monkeypatch.setattr(Monitor, "_begin", lambda self, name: None)
    with Monitor(started=0.0).campaign(4) as step:  # begins at 0 and 20; then the clock is asked twice or more a task
        for number in range(4):
            step(f"task {number}", True)
    lines = capsys.readouterr().err.splitlines()
    times = ["1:00", "1:20", "0:47", "0:00"]  # 20 s at the first task, then 60 s more at each
    assert lines == [f"tissuq: {n + 1} of 4, {left} left, task {n}" for n, left in enumerate(times)]


def test_verbose_tells_how_long_every_stage_took(done, specimen, monkeypatch):
    monkeypatch.setattr(progress, "Timer", Endless)
    said = done("fit", specimen, *ALONE, "--verbose")
    stages = re.findall(r"^tissuq: (.+): \d+\.\d s$", said.err, flags=re.MULTILINE)
    assert stages == ["none", "assessing", "writing"]


def test_verbose_tells_how_long_reading_a_run_took(cli, done, specimen, monkeypatch):
    monkeypatch.setattr(progress, "Timer", Endless)
    done("fit", specimen, *ALONE, "--discrepancy", "constant", "--out", "run")
    assert re.fullmatch(r"tissuq: reading: \d+\.\d s\n", cli("show", "run", "--verbose").err)
    assert re.findall(r"tissuq: (\w+): \d+\.\d s\n", cli("compare", "run", "--verbose").err) == ["reading", "comparing"]


def test_quiet_leaves_the_json_of_a_run_and_prints_the_numbers_of_a_comparison_alone(cli, done, specimen):
    done("fit", specimen, *ALONE, "--discrepancy", "constant", "--out", "run")
    assert cli("show", "run", "--json", "--quiet").out == cli("show", "run", "--json").out
    loud, quiet = cli("compare", "run").out, cli("compare", "run", "-q")
    assert quiet.status == 0
    assert [line for line in quiet.out.splitlines() if line.partition(": ")[0] not in " ".join(loud.split())] == []
    assert 0 < len(quiet.out.splitlines()) < len(loud.splitlines())


def test_the_log_of_a_run_says_version_command_and_stages_and_nothing_of_the_machine(done, here, specimen):
    done("fit", specimen.name, *ALONE)
    text = (here / "runs" / "specimen" / LOG).read_text()
    assert re.search(r"UTC  tissuq \S+, Python \d", text)
    assert "command: tissuq fit specimen.csv --noise-sd 1 --discrepancy none --no-figures\n" in text
    assert re.findall(r"^ *\d+\.\d s  (\w+)$", text, flags=re.MULTILINE) == ["none", "assessing", "writing", "written"]
    for private in (str(here), socket.gethostname(), str(Path.home()) + "/", sys.prefix):
        assert private not in text


def test_the_log_is_of_the_run_and_goes_with_it_when_it_is_replaced(done, here, specimen):
    for options in ((), ("--force",)):
        done("fit", specimen.name, *ALONE, *options)
    assert (here / "runs" / "specimen" / LOG).read_text().count("command: ") == 1


@pytest.mark.parametrize("folder", [None, Path("runs/bar")])
def test_what_is_said_when_stopped_names_what_is_done_and_how_to_go_on(folder, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["tissuq", "structure", "my run"])
    monitor = Monitor(stages=[("loading", 0.0), ("", 1.0), ("fitting", 1.0)], folder=folder, tasks=9, tasks_done=4)
    if folder is None:
        wanted = "stopped during 'fitting' (done: loading); no run was written. To begin again: "
    else:
        wanted = "stopped; 4 of 9 tasks are done and kept in 'runs/bar'. To go on: "
    assert monitor.stopped() == wanted + "tissuq structure 'my run'"


def test_quiet_prints_the_answer_of_a_ranking_alone(cli, refused, done, here, specimen):
    done("fit", specimen, *ALONE, "--out", "run")
    options = ("--candidate", "planar 1.05:1.2 6", "--no-figures")
    said = cli("design", "run", *options, "--quiet")
    assert (said.status, said.err) == (0, "")
    (line,) = said.out.splitlines()
    loud = cli("design", "run", *options, "--force").out
    name, _, value = line.partition(": ")
    assert name in loud
    assert value in " ".join(loud.split())
    refused(["no run folder"], "design", "nowhere", "--quiet")


def test_quiet_prints_the_numbers_of_a_fit_alone(cli, here, specimen):
    said = cli("fit", specimen, *ALONE, "--out", "run", "--quiet")
    assert (said.status, said.err) == (0, "")
    loud = " ".join(cli("show", "run").out.split())
    assert said.out
    assert cli("show", "run", "--quiet") == said
    for line in said.out.splitlines():
        name, _, value = line.partition(": ")
        assert f"{name} {value}" in loud


def test_the_log_names_a_file_elsewhere_without_its_folders(here, monkeypatch):
    file, folder = here / "secret" / "skin.csv", here / "results"
    monkeypatch.setattr(sys, "argv", ["tissuq", "fit", str(file), f"--out={folder}", "--prior", "C10=uniform(0,5)"])
    Monitor().write_log(here)
    assert "command: tissuq fit skin.csv --out=results --prior 'C10=uniform(0,5)'\n" in (here / LOG).read_text()
