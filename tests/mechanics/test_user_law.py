"""A law of the user's own: a file and a name, checked before anything is fitted, and told what is wrong in words."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pytest

import tissuq as tq
from class_law import SIMPLE
from loading import MEASURED
from tissuq import registry
from tissuq.mechanics import material_named, named

LAWS = f'''
import jax
import jax.numpy as jnp
from tissuq import Material, Parameter, Uniform

def exponential(I1, I2, mu, b=Uniform(0.1, 20)):
    """mu/(2 b) (exp(b (I1 - 3)) - 1)"""
    return mu / (2 * b) * jnp.expm1(b * (I1 - 3))

def logarithmic(l1, l2, l3, mu):
    return mu * sum(jnp.log(each) ** 2 for each in (l1, l2, l3))

{SIMPLE}
made = Simple()
number = 3

def lifted(I1, I2, mu):
    return mu * I1

def broken(I1, I2, mu):
    return mu * (I1 - unknown)

def bent(I1, I2, mu, b):
    return mu / b * jnp.expm1(b * (I1 - 3))

def soft(I1, I2, mu):
    return -mu * (I1 - 3)

def rooted(I1, I2, mu):
    return mu * jnp.sqrt(I1 - 4)

def valued(I1, I2, mu=1.0):
    return mu * (I1 - 3)

def misnamed(x, y, mu):
    return mu * x

def shifted(I1, I2, mu):
    return mu * (I1 - 3) + 1e-3 * mu

def halting(I1, I2, mu):
    return mu * (I1 - 3) + 1e-3 * mu * jax.lax.stop_gradient(jnp.asarray(I1 - 3))

def curved(I1, I2, mu):
    return mu * (1 + 1e-3 * mu) * (I1 - 3)

class Nameless(Material):
    def strain_energy(self, I1, I2, values):
        return values[0] * (I1 - 3)
'''


@pytest.fixture
def laws(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "laws.py").write_text(LAWS)
    (tmp_path / "failing.py").write_text("first = 1\nraise ValueError('not today')\n")
    (tmp_path / "wrong.py").write_text("def W(:\n")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "same", "values"),
    [
        ("exponential", "demiray", [1.3, 0.7]),
        pytest.param("logarithmic", "hencky", [1.3], marks=pytest.mark.slow),
        ("Simple", "neo-hookean", [1.3]),
        pytest.param("made", "neo-hookean", [1.3], marks=pytest.mark.slow),
    ],
)
def test_a_law_in_a_file_is_the_law_of_the_library(laws, name, same, values):
    own, known = tq.load_material(f"laws.py:{name}"), material_named(same)
    for each in MEASURED[::4]:
        found, expected = (tq.engineering_stress(law, each.path, each.points, values) for law in (own, known))
        np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.slow
def test_an_argument_is_linear_without_a_default_and_has_its_prior_otherwise(laws):
    law = tq.load_material("laws.py:exponential")
    assert [(p.symbol, p.unit, p.is_linear) for p in law.parameters] == [("mu", "MPa", True), ("b", "", False)]
    data = tq.simulate(law, {"mu": 0.1, "b": 2.0}, np.linspace(0.7, 1.4, 15), noise_sd=1e-3, seed=1)
    posterior = tq.fit(data, material=law, discrepancy="none")
    assert posterior.model.priors["b"] == tq.Uniform(0.1, 20)
    low, high = posterior.summary().loc["b", ["hdi_low", "hdi_high"]]
    assert low < 2.0 < high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "claim"),
    [
        ("shifted", "the energy is zero at the reference"),
        ("halting", "the stress is the derivative of the energy"),
        ("curved", "the stress is proportional to mu"),
    ],
)
def test_a_law_that_is_wrong_by_a_thousandth_is_found(laws, law, claim):
    with pytest.raises(tq.InputError, match=claim):
        tq.load_material(f"laws.py:{law}")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("laws.py:lifted", r"the energy is zero at the reference \(there it is 3 MPa\)"),
        ("laws.py:broken", r"'laws.py' fails, line 29: NameError: name 'unknown'"),
        ("laws.py:bent", "proportional to mu, b"),
        ("laws.py:soft", "initial shear modulus is positive"),
        ("laws.py:rooted", "the energy is finite"),
        ("laws.py:valued", r"its argument 'mu=1.0' is not plain.*Write a function"),
        ("laws.py:misnamed", r"has the arguments x, y, mu\. Write a function W\(I1, I2"),
        ("laws.py:Nameless", "lacks name, parameters"),
        ("laws.py:number", r"no material \(it is 3\)"),
        ("laws.py:gone", "nothing named 'gone'; it defines exponential, logarithmic, Simple"),
        ("failing.py:W", "'failing.py' fails, line 2: ValueError: not today"),
        ("wrong.py:W", "'wrong.py' is not Python, line 1"),
        ("nowhere.py:W", "there is no file 'nowhere.py'"),
        ("laws.py", "write path.py:Name"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(laws, law, words):
    with pytest.raises(tq.InputError, match=words):
        tq.load_material(law)


def test_a_law_in_a_file_is_run_only_where_a_person_names_it(laws):
    (laws / "trap.py").write_text("raise SystemExit('run')\n")
    with pytest.raises(tq.ModelError, match="run only where you name it yourself"):
        material_named("trap.py:W")
    with pytest.raises(tq.InputError, match="SystemExit"):
        material_named("trap.py:W", laws=True)


@pytest.mark.slow
def test_a_law_in_a_file_can_be_part_of_a_sum(laws):
    law = material_named("laws.py:logarithmic+mooney-rivlin", laws=True)
    assert [p.symbol for p in law.parameters] == ["mu", "C10", "C01"]


def from_elsewhere(I1, I2, mu):
    return mu * (I1 - 3)


def test_another_package_adds_a_material_through_an_entry_point(monkeypatch):
    points = EntryPoints(
        [
            EntryPoint("from_elsewhere", f"{__name__}:from_elsewhere", tq.Material.entry_point_group),
            EntryPoint("lost", "no_such_module:Law", tq.Material.entry_point_group),
        ]
    )
    monkeypatch.setattr(registry, "entry_points", lambda **wanted: points.select(**wanted))
    assert [p.symbol for p in material_named("from_elsewhere").parameters] == ["mu"]
    with pytest.raises(tq.ModelError, match="'lost' of another package"):
        material_named("lost")
    with pytest.warns(UserWarning, match="'lost' of another package .* Repair or uninstall"):
        assert [law.name for law in named.plugins()] == ["from_elsewhere"]
