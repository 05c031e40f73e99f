"""A law of one's own on the command line: checked, fitted, recorded, and never run because a file names it."""

import tomllib

import pytest

LAW = '''
import jax.numpy as jnp
from tissuq import Uniform

print("run")

def exponential(I1, I2, mu, b=Uniform(0.1, 20)):
    """mu/(2 b) (exp(b (I1 - 3)) - 1)"""
    return mu / (2 * b) * jnp.expm1(b * (I1 - 3))

def lifted(I1, I2, mu):
    return mu * I1

def broken(I1, I2, mu):
    return mu * (I1 - unknown)
'''
FIT = "--discrepancy", "none", "--noise-sd", "1", "--no-figures"


@pytest.fixture
def law(here):
    (here / "law.py").write_text(LAW)
    return here / "law.py"


@pytest.mark.slow
def test_a_law_is_checked(cli, law):
    said = cli("check", "law.py:exponential")
    assert (said.status, said.err) == (0, "")
    assert "parameters: mu (MPa), b" in said.out
    assert "holds: the stress is proportional to mu" in said.out


def test_a_material_of_the_library_is_checked_by_name(done):
    said = done("check", "gent+rivlin:C01")
    assert "FAILS" not in said.out


@pytest.mark.slow
def test_a_law_is_fitted_as_that_of_the_library(cli, law, specimen):
    own = cli("fit", specimen, "--material", "law.py:exponential", *FIT, "--out", "own")
    known = cli("fit", specimen, "--material", "demiray", *FIT, "--prior", "b=uniform(0.1,20)", "--out", "known")
    assert (own.status, known.status) == (0, 0)
    tables = [cli("show", run, "--details").out.splitlines() for run in ("own", "known")]
    rows = [next(line.split() for line in table if line.split()[:1] == ["none"]) for table in tables]
    assert rows[0][:5] == rows[1][:5]  # the evidence also tells that mu of demiray is positive


@pytest.mark.slow
def test_a_law_is_fitted_recorded_and_repeated_with_its_name(cli, done, law, here, specimen):
    done("fit", specimen, "--material", "law.py:exponential", *FIT, "--out", "own")
    recipe = tomllib.loads((here / "own" / "run.toml").read_text())
    assert recipe["material"] == "input/law.py:exponential"
    assert (here / "own" / "input" / "law.py").read_text() == LAW
    law.unlink()
    refused = cli("fit", "--config", "own/run.toml", "--out", "again")
    assert refused.status == 2
    assert "run only where you name it yourself" in refused.err
    assert "run\n" not in refused.out
    done("fit", "--config", "own/run.toml", "--material", "own/input/law.py:exponential", "--out", "again")
    assert (here / "again" / "parameters.csv").read_text() == (here / "own" / "parameters.csv").read_text()


@pytest.mark.parametrize(
    ("material", "words"),
    [
        ("law.py:lifted", ["law.py:lifted", "zero at the reference", "3 MPa"]),
        ("law.py:broken", ["'law.py' fails, line 15", "NameError"]),
        ("law.py:gone", ["nothing named 'gone'", "exponential, lifted, broken"]),
        ("nowhere.py:Law", ["no file 'nowhere.py'"]),
        ("neo-hookean+yeoh", ["C10 twice"]),
        ("rivlin:C1", ["Rivlin polynomial", "C1"]),
    ],
)
@pytest.mark.parametrize("command", ["fit", "check"])
def test_a_law_that_cannot_be_used_is_refused_in_words(cli, law, here, specimen, command, material, words):
    arguments = ["fit", specimen, "--material", material] if command == "fit" else ["check", material]
    said = cli(*arguments)
    assert said.status == 2
    assert all(word in said.err for word in words)
    assert "Traceback" not in said.err
    assert not (here / "runs").exists()
