"""A posterior that is saved and loaded is the same posterior, by every route and to the last digit."""

from __future__ import annotations

from dataclasses import asdict

import h5py
import numpy as np
import pytest
import xarray as xr

import gallery
import tissuq as tq
from tissuq.mechanics.arithmetic import expm1
from tissuq.prediction.densities import leave_one_out

STRETCH = np.array([0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0])
STIFFENING = {"C10": 0.5, "C20": 0.1, "C30": 0.0}


def measured(mode="uniaxial", seed=1):
    return tq.simulate("yeoh", STIFFENING, STRETCH, noise_sd=0.02, mode=mode, seed=seed)


def two_specimens():
    return [measured(), measured("planar", 2)]


EXPONENT = tq.Uniform(0.1, 5.0)
TIGHT = {"C10": tq.Uniform(0.0, 0.55), "C01": tq.Uniform(0.0, 0.1)}
FITS = {
    "closed form": lambda: tq.fit(measured(), discrepancy="none", noise_sd=0.02),
    "quadrature": lambda: tq.fit(measured(), discrepancy="yeoh", noise_sd=0.02, seed=7),
    "bounds that cut": lambda: tq.fit(
        measured(), material="mooney-rivlin", discrepancy="none", noise_sd=0.3, priors=TIGHT
    ),
    "flat prior": lambda: tq.fit(measured(), discrepancy="constant", priors={"C10": tq.Flat()}),
    "process": lambda: tq.fit(measured(), discrepancy="gp", noise_sd=0.02),
    "energies": lambda: tq.fit(measured(), discrepancy="taylor+hencky", noise_sd=0.02),
    "average of two tests": lambda: tq.fit(two_specimens(), discrepancy="auto"),
    "exponents": lambda: tq.fit(measured(), material="ogden-1", discrepancy="none", noise_sd=0.02),
    "exponents beside an energy": lambda: tq.fit(measured(), material="ogden-1", discrepancy="taylor"),
    "noise by test": lambda: tq.fit(two_specimens(), discrepancy="linear", noise_sd=[0.02, 0.03]),
    "proportional": lambda: tq.fit(measured(), discrepancy="none", noise="proportional"),
    "autoregressive": lambda: tq.fit(measured(), discrepancy="none", noise="autoregressive"),
    "nuts": lambda: tq.fit(measured(), discrepancy="linear", method="nuts"),
    "joint": gallery.sampled_jointly,
    "stable": lambda: tq.fit(measured(), discrepancy="none", noise_sd=0.02, stable_in="uniaxial"),
    "stable average": lambda: tq.fit(measured(), discrepancy="auto", noise_sd=0.02, stable_in="uniaxial"),
}


SLOW = ("nuts", "joint", "exponents beside an energy", "average of two tests", "stable average")
"""What is sampled, and of two that have exponents, are stable or are of several tests the dearer one."""
SAVED_AGAIN = ("closed form", "process", "energies")
"""Those that are saved a second time in the quick tests."""


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in FITS],
)
def pair(request, tmp_path_factory):
    """A posterior, and what comes back from the file in which it was saved."""
    posterior, path = FITS[request.param](), tmp_path_factory.mktemp("saved") / "posterior.nc"
    posterior.save(path)
    return posterior, tq.Posterior.load(path), path


def same(one, other):
    np.testing.assert_array_equal(np.asarray(one), np.asarray(other))


def test_every_number_comes_back(pair):
    before, after, _ = pair
    same(before.summary(), after.summary())
    assert (before.log_evidence, before.log_evidence_error) == (after.log_evidence, after.log_evidence_error)
    assert (before.method, before.seed, before.warnings) == (after.method, after.seed, after.warnings)
    assert before.how == after.how
    assert dict(before.solution.members) == dict(after.solution.members)
    assert before.solution.stable_in == after.solution.stable_in
    for name in ("stable_share", "stable_prior_share"):
        assert getattr(before.solution, name) == getattr(after.solution, name)
    assert before.diagnostics == after.diagnostics
    for symbol, marginal in before.marginals.items():
        for name, value in asdict(marginal).items():
            same(value, getattr(after.marginals[symbol], name))


def test_draws_and_densities_come_back(pair):
    before, after, _ = pair
    for symbol, drawn in before.solution.draws.items():
        same(drawn, after.solution.draws[symbol])
    same(before.solution.component_of_draw, after.solution.component_of_draw)
    if before.solution.drawn_discrepancy is None:
        assert after.solution.drawn_discrepancy is None
    else:
        same(before.solution.drawn_discrepancy, after.solution.drawn_discrepancy)
    same(leave_one_out(before.solution).log_density, leave_one_out(after.solution).log_density)


def test_predictions_come_back(pair):
    before, after, _ = pair
    for options in ({}, {"discrepancy": False, "noise": False}):
        one, other = (each.predict([1.1, 1.6], mode="uniaxial", **options) for each in (before, after))
        same(one, other)
    same(before.initial_shear_modulus.points, after.initial_shear_modulus.points)


def test_the_model_comes_back(pair):
    before, after, _ = pair
    model, other = before.model, after.model
    assert (model.material, model.discrepancy, model.noise) == (other.material, other.discrepancy, other.noise)
    assert (model.priors, model.tolerances, model.chosen_priors) == (
        other.priors,
        other.tolerances,
        other.chosen_priors,
    )
    assert before.solver == after.solver
    for name, value in vars(model.fitted_errors).items():
        same(value, getattr(other.fitted_errors, name))
    for one, two in zip(model.experiment.tests, other.experiment.tests, strict=True):
        same(one.stretch, two.stretch)
        same(one.stress, two.stress)
        for name in ("mode", "name", "source", "stress_unit", "specimen"):
            assert getattr(one, name) == getattr(two, name)


@pytest.mark.parametrize(
    "pair",
    [name if name in SAVED_AGAIN else pytest.param(name, marks=pytest.mark.slow) for name in FITS],
    indirect=True,
)
def test_what_is_saved_again_is_the_same(pair, tmp_path):
    _, after, path = pair
    after.save(tmp_path / "again.nc")
    with xr.open_datatree(path, engine="h5netcdf") as one, xr.open_datatree(tmp_path / "again.nc") as other:
        xr.testing.assert_identical(one.load(), other.load())


@pytest.mark.slow
def test_arviz_reads_the_same_arrays_from_the_file_as_in_memory(pair):
    before, _, path = pair
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        assert {"posterior", "posterior_predictive", "log_likelihood", "observed_data"} < set(tree.children)
        assert tree.attrs == before.data.attrs
        for name, group in before.data.children.items():
            xr.testing.assert_identical(tree[name].to_dataset(), group.to_dataset())


def test_further_measurements_are_added_to_a_loaded_posterior(tmp_path):
    before = tq.fit(measured(), discrepancy="none", noise_sd=0.02)
    before.save(tmp_path / "p.nc")
    after = tq.Posterior.load(tmp_path / "p.nc")
    more = tq.simulate("yeoh", STIFFENING, [1.15, 1.25], noise_sd=0.02, seed=3)
    same(before.update(more).summary(), after.update(more).summary())
    assert before.assess() == after.assess()


def test_a_law_of_ones_own_is_given_and_never_run(tmp_path):
    def demiray(I1, I2, mu, b=EXPONENT):
        return mu / (2 * b) * (expm1(b * (I1 - 3)))

    def other(I1, I2, mu, k=EXPONENT):
        return mu / 2 * (I1 - 3) + k * 0 * I2

    other.__name__ = "demiray"
    before = tq.fit(measured(), material=tq.FunctionLaw(demiray), discrepancy="none", noise_sd=0.05)
    before.save(tmp_path / "p.nc")
    with pytest.raises(tq.InputError, match="material 'demiray' of this posterior is your own"):
        tq.Posterior.load(tmp_path / "p.nc")
    with pytest.raises(tq.InputError, match="is of the material 'demiray', not 'yeoh'"):
        tq.Posterior.load(tmp_path / "p.nc", material=tq.materials()["yeoh"]())
    with pytest.raises(tq.InputError, match="has the parameters mu, b; the one given has others"):
        tq.Posterior.load(tmp_path / "p.nc", material=tq.FunctionLaw(other))
    after = tq.Posterior.load(tmp_path / "p.nc", material=tq.FunctionLaw(demiray))
    same(before.summary(), after.summary())


def test_a_discrepancy_of_a_package_that_is_not_here_or_was_changed_is_named(tmp_path):
    class Bump(tq.Discrepancy):
        """A mean b (l - 1)^4; its name is not kept among those of classes."""

        name = property(lambda self: "bump")
        parameters = (tq.Parameter("b", "size of the bump"),)

        def mean_basis(self, states):
            return np.reshape(states.abscissa - 1, (-1, 1)) ** 4

    class Moved(Bump):
        def mean_basis(self, states):
            return np.reshape(states.abscissa - 1, (-1, 1)) ** 5

    tq.fit(measured(), discrepancy=Bump(), noise_sd=0.05).save(tmp_path / "p.nc")
    with pytest.raises(tq.InputError, match=r"discrepancy 'bump' .* or of a package .* give it in Python as disc"):
        tq.Posterior.load(tmp_path / "p.nc")
    with pytest.raises(tq.InputError, match=r"other stresses than .* or else the discrepancy 'bump'"):
        tq.Posterior.load(tmp_path / "p.nc", discrepancy=Moved())


def test_a_law_that_was_changed_since_the_fit_is_refused(tmp_path):
    """Twice the stress with the same parameters: predictions were twice what was measured."""

    def written(factor, growth=1.0):
        def own_law(I1, I2, mu, b=EXPONENT):
            return factor * mu / (2 * b * growth) * expm1(growth * b * (I1 - 3))

        return tq.FunctionLaw(own_law)

    tq.fit(measured(), material=written(1.0), discrepancy="none", noise_sd=0.05).save(tmp_path / "p.nc")
    for changed in (written(2.0), written(1.0, growth=1.1)):
        with pytest.raises(tq.InputError, match="'own_law' has other stresses than when this posterior was fitted"):
            tq.load(tmp_path / "p.nc", material=changed)
    tq.load(tmp_path / "p.nc", material=written(1.0))


@pytest.mark.parametrize("name", ["fit/mixture/root", "fit/mixture/settings", "fit/model/curve", "fit/tests/1"])
@pytest.mark.parametrize("change", ["deleted", "renamed", "emptied"])
def test_a_file_of_which_something_was_changed_is_refused(tmp_path, name, change):
    """Without its roots it had been loaded as a posterior that is certain, without settings it ended in a traceback."""
    path = tmp_path / "p.nc"
    tq.fit(two_specimens(), discrepancy="mooney-rivlin", noise_sd=0.02).save(path)
    with h5py.File(path, "r+") as file:
        if change == "renamed":
            file.move(name, f"{name}_of_earlier")
        else:
            del file[name]
        if change == "emptied":
            file[name] = np.zeros((0, 1))
    with pytest.raises(tq.InputError, match="was changed since it was written"):
        tq.load(path)


def test_a_file_that_xarray_wrote_again_as_it_was_is_loaded(tmp_path):
    posterior = tq.fit(measured(), discrepancy="taylor", noise_sd=0.02)
    posterior.save(tmp_path / "p.nc")
    with xr.open_datatree(tmp_path / "p.nc", engine="h5netcdf") as tree:
        tree.to_netcdf(tmp_path / "again.nc", engine="h5netcdf")
    same(posterior.summary(), tq.load(tmp_path / "again.nc").summary())


def test_a_damaged_or_foreign_file_is_said(tmp_path):
    path = tmp_path / "p.nc"
    with pytest.raises(tq.InputError, match="there is no posterior"):
        tq.Posterior.load(path)
    posterior = tq.fit(measured(), discrepancy="none", noise_sd=0.02)
    posterior.save(path)
    whole = path.read_bytes()
    for content in (b"", b"stretch,stress\n1,2\n", whole[: len(whole) // 2], whole[:2000] + bytes(4000) + whole[6000:]):
        path.write_bytes(content)
        with pytest.raises(tq.InputError, match="is damaged or no posterior of tissuq"):
            tq.Posterior.load(path)
    means = posterior.solution.mixture.mean.tobytes()
    assert whole.count(means) == 1
    path.write_bytes(whole.replace(means, means[:-2] + bytes([means[-2] ^ 1]) + means[-1:]))  # one bit of one number
    with pytest.raises(tq.InputError, match="is damaged or no posterior of tissuq"):
        tq.Posterior.load(path)
    posterior.data.to_netcdf(path, engine="h5netcdf")
    with pytest.raises(tq.InputError, match="holds draws, and not the whole posterior"):
        tq.Posterior.load(path)
