"""Solvers: commands, their end, and what they leave when they fail, hang or are not there."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from tissuq.decks import CalculiXSolver, CommandSolver, FEBioSolver, solver_for
from tissuq.errors import InputError

PYTHON = Path(sys.executable).as_posix()


def python(code):
    return f'"{PYTHON}" -c "{code}" {{job}} {{deck}}'


def test_the_command_of_a_solver_is_its_template_with_the_deck():
    assert CalculiXSolver().words("plate", "plate.inp") == ["ccx", "-i", "plate"]
    assert FEBioSolver().words("plate", "plate.feb") == ["febio4", "-i", "plate.feb"]
    assert CommandSolver("abaqus job={job} ask=off").words("plate", "x") == ["abaqus", "job=plate", "ask=off"]


def test_the_solver_is_that_of_the_deck_unless_another_is_named():
    assert [solver_for(deck, None).name for deck in ("abaqus", "febio")] == ["ccx", "febio4"]
    assert solver_for("abaqus", None, "abaqus job={job}").name == "command"
    assert solver_for("abaqus", "ccx", "mpirun ccx {job}").card_format == "calculix"
    with pytest.raises(InputError, match="needs its command"):
        solver_for("ls-dyna", None)
    with pytest.raises(InputError, match="reads decks of the format abaqus, not febio"):
        solver_for("febio", "ccx")
    with pytest.raises(InputError, match="no solver named 'cxx'"):
        solver_for("abaqus", "cxx")


@pytest.mark.parametrize("command", ["run {name}", "run '{job}", "run {"])
def test_a_command_that_is_not_understood_is_refused(command):
    with pytest.raises(InputError, match="not understood"):
        CommandSolver(command)


def test_a_program_that_is_not_there_is_told_before_anything_runs():
    with pytest.raises(InputError, match="no program 'no-such-solver'"):
        CommandSolver("no-such-solver {job}").check_installed()


@pytest.mark.parametrize(
    ("kind", "code", "problem"),
    [
        (CommandSolver, "print(1)", ""),
        (CommandSolver, "raise SystemExit(3)", "status 3"),
        (CalculiXSolver, "print('Job finished')", ""),
        (CalculiXSolver, "print(1)", "did not finish"),
        (CalculiXSolver, "print(' *ERROR in e_c3d: nonpositive jacobian')", "in e_c3d: nonpositive jacobian"),
        (
            CalculiXSolver,
            "print(' *ERROR in umat: a law of fibres\\n        needs one more constant.\\n\\n best residual')",
            "in umat: a law of fibres needs one more constant.",
        ),
        (FEBioSolver, "print('N O R M A L   T E R M I N A T I O N')", ""),
        (FEBioSolver, "print('E R R O R   T E R M I N A T I O N')", "without a normal termination"),
    ],
)
def test_how_a_run_ended(tmp_path, kind, code, problem):
    outcome = kind(python(code)).run(tmp_path, "plate.inp")
    assert bool(outcome.problem) == bool(problem)
    assert problem in outcome.problem
    assert bool(outcome.lines) == bool(problem and "print" in code)


@pytest.mark.slow
def test_a_run_that_takes_too_long_is_ended_with_all_that_it_started(tmp_path):
    child = "import time;time.sleep(2);open(chr(97),chr(119))"  # which leaves a file named "a"
    code = f"import subprocess,sys,time;subprocess.Popen([sys.executable,'-c','{child}']);"
    code += "print('at work',flush=True);time.sleep(600)"
    outcome = CommandSolver(python(code)).run(tmp_path, "p.inp", 1.0)
    assert (outcome.problem, outcome.lines) == ("stopped after 1 s", ("at work",))
    time.sleep(2.5)
    assert not (tmp_path / "a").exists()


def test_results_are_trusted_up_to_the_last_increment_that_converged(tmp_path):
    rows = " 1  1  1   7  0.2   0.2   0.2\n 1  2  2   3  0.25  0.25  0.05\n 1  3  1U  4  0.25  0.25  0.05\n"
    (tmp_path / "job.sta").write_text("SUMMARY OF JOB INFORMATION\n  STEP  INC  ATT ITRS  TOT  STEP  INC\n" + rows)
    assert CalculiXSolver().last_time(tmp_path, "job") == 0.25
    assert CalculiXSolver().last_time(tmp_path, "other") == float("inf")
