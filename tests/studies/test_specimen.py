import numpy as np
import pytest
from pydantic import ValidationError

from marks import slow_but
from tissuq.errors import ConvergenceError, InputError, ModelError
from tissuq.posterior import fitting
from tissuq.studies import specimen
from tissuq.studies.specimen import SpecimenSettings, run_specimen, steps_of

STRETCH = np.array([0.8, 0.9, 1.1, 1.2, 1.3, 1.4, 1.6])
STRESS_KPA = 100 * (STRETCH - STRETCH**-2) + np.array([1, 0, 0.5, -1, 0, -0.5, 0.25])


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "specimen.csv"
    rows = [f"{stretch!r},{stress!r}\n" for stretch, stress in zip(STRETCH.tolist(), STRESS_KPA.tolist(), strict=True)]
    path.write_text("stretch,stress_kPa\n" + "".join(rows))
    return path


def study(file, **settings):
    return run_specimen(SpecimenSettings(**{"file": str(file), "discrepancies": ("all",)} | settings))


@pytest.fixture(params=slow_but(["few"], ["few", "every"]))
def offered(request, monkeypatch):
    """What `all` stands for: all the discrepancies, and in the quick tests four."""
    names = specimen._every()
    if request.param == "few":
        names = [name for name in names if name in ("none", "quadratic", "mooney-rivlin", "gp")]
        monkeypatch.setattr("tissuq.studies.specimen._every", lambda: names)
    return names


def test_all_stands_for_the_discrepancies_of_the_paper_and_auto():
    assert specimen._every()[0] == "none"
    assert set(specimen._every()) == {
        "none", "constant", "linear", "quadratic", "mooney-rivlin", "yeoh", "gp", "auto"
    }  # fmt: skip


def test_noise_and_stress_priors_are_read_in_the_unit_of_the_file(file):
    priors = {"C10": {"distribution": "normal", "mean": 40, "sd": 2}}
    found = study(file, discrepancies=("none",), noise_sd=1.0, priors=priors)
    unit_stress = 2 * (STRETCH - STRETCH**-2)
    precision = unit_stress @ unit_stress + 1 / 4
    mean = (unit_stress @ STRESS_KPA + 40 / 4) / precision
    marginal = found.posteriors["none"].solution.marginals["C10"]
    assert 1000 * marginal.mean == pytest.approx(mean, rel=1e-6)
    assert 1000 * marginal.sd == pytest.approx(precision**-0.5, rel=1e-6)
    assert (found.unit.name, found.unit.to_mpa) == ("kPa", 1e-3)


def test_a_prior_of_a_length_is_not_converted(file):
    priors = {"psi": {"distribution": "uniform", "low": 0.1, "high": 0.7}}
    found = study(file, discrepancies=("gp",), noise_sd=1.0, priors=priors)
    assert str(found.posteriors["gp"].model.priors["psi"]) == "uniform(0.1, 0.7)"


def test_each_discrepancy_gets_the_priors_of_its_own_parameters(file):
    priors = {"S": {"distribution": "half-normal", "sd": 5}}
    found = study(file, discrepancies=("none", "constant"), noise_sd=1.0, priors=priors)
    assert str(found.posteriors["constant"].model.priors["S"]) == "half-normal(0.005)"
    assert "S" not in found.posteriors["none"].model.priors


@pytest.mark.slow
def test_all_discrepancies_are_fitted_and_those_that_do_not_apply_are_skipped_with_the_reason(file, offered):
    found = study(file, material="mooney-rivlin", noise_sd=1.0)
    assert next(iter(found.posteriors)) == "none"
    assert set(found.posteriors) | set(found.skipped) == set(offered)
    assert set(found.skipped) == {"mooney-rivlin"}
    assert "C01" in found.skipped["mooney-rivlin"]
    assert found.seconds.keys() == found.posteriors.keys()


def test_the_number_of_steps_is_known_before_they_are_announced(file):
    settings = SpecimenSettings(file=str(file), discrepancies=("none", "constant", "none"), noise_sd=1.0)
    announced = []
    run_specimen(settings, step=announced.append)
    assert announced == ["none", "constant", "assessing"]
    assert steps_of(settings) == len(announced)


def test_a_discrepancy_with_more_parameters_than_measurements_is_skipped_when_all_are_asked_for(tmp_path, offered):
    file = tmp_path / "four.csv"
    file.write_text("stretch,stress_kPa\n0.8,-75\n0.9,-33\n1.1,28\n1.2,50\n")
    found = study(file, noise_sd=1.0)
    assert found.skipped.keys() == {"quadratic"}
    assert "4 measurements" in found.skipped["quadratic"]


def test_a_discrepancy_with_more_parameters_than_measurements_is_an_error_when_it_is_named(tmp_path):
    file = tmp_path / "four.csv"
    file.write_text("stretch,stress_kPa\n0.8,-75\n0.9,-33\n1.1,28\n1.2,50\n")
    with pytest.raises(InputError, match="4 measurements for 5 parameters"):
        study(file, noise_sd=1.0, discrepancies=("none", "quadratic"))


def test_it_is_an_error_when_nothing_can_be_fitted(tmp_path):
    file = tmp_path / "one.csv"
    file.write_text("stretch,stress_kPa\n1.1,28\n")
    with pytest.raises(ModelError, match="not even 'none': 1 measurements"):
        study(file)


@pytest.mark.parametrize("names", [("all",), ("none", "gp")], ids=["all", "by name"])
def test_a_method_that_does_not_reach_its_tolerance_spoils_only_its_own_row_when_all_are_asked_for(
    file, monkeypatch, names, offered
):
    def fit(*arguments, discrepancy, **options):
        if discrepancy == "gp":
            raise ConvergenceError("quadrature did not reach its tolerance.")
        return fitting.fit(*arguments, discrepancy=discrepancy, **options)

    monkeypatch.setattr(specimen, "fit", fit)
    if names == ("all",):
        found = study(file, noise_sd=1.0, discrepancies=names)
        assert found.skipped == {"gp": "quadrature did not reach its tolerance."}
        assert len(found.posteriors) == len(offered) - 1
    else:
        with pytest.raises(ConvergenceError):
            study(file, noise_sd=1.0, discrepancies=names)


def test_a_discrepancy_that_is_named_twice_is_fitted_once(file):
    steps = []
    settings = SpecimenSettings(file=str(file), discrepancies=("none", "none"), noise_sd=1.0)
    found = run_specimen(settings, step=steps.append)
    assert steps == ["none", "assessing"]
    assert list(found.posteriors) == ["none"]


def test_a_prior_of_a_parameter_that_no_discrepancy_has_is_refused(file):
    with pytest.raises(InputError, match=r"prior for 'm0'.*C10, noise_sd"):
        study(file, discrepancies=("none",), priors={"m0": {"low": 0, "high": 1}})


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"discrepancies": ("none", "cubic")}, "no discrepancy named 'cubic'"),
        ({"stable_in": ("uniaxial", "tension")}, "no loading mode named 'tension'"),
        ({"stable_in": ("biaxial",)}, "modes of one stretch and one stress"),
        ({"tolerances": {"force": 0.1}}, "'force'"),
    ],
)
def test_an_unknown_name_is_refused_before_anything_is_read(wrong, words):
    with pytest.raises(ValidationError, match=words):
        SpecimenSettings(file="nowhere.csv", **wrong)


@pytest.mark.parametrize("noise", [0, -1.0, float("nan"), float("inf"), True, "small", None])
def test_a_noise_that_is_not_a_positive_number_is_refused(noise):
    with pytest.raises(ValidationError, match="positive number in the file's stress unit, or 'unknown'"):
        SpecimenSettings(file="x.csv", noise_sd=noise)


@pytest.mark.parametrize(
    "wrong", [{"discrepancies": ()}, {"discrepancies": ("all", "gp")}, {"seed": -1}, {"skip_rows": -1},
              {"method": "gibbs"}, {"sampler": "nuts"}, {"noise": "white"}, {"noise": "repeats", "noise_sd": 1.0},
              {"unknown": 1}, {"priors": {"C10": 5}}, {"priors": {"C10": {"low": [1]}}}],
    ids=str,
)  # fmt: skip
def test_settings_that_mean_nothing_are_refused(wrong):
    with pytest.raises(ValidationError):
        SpecimenSettings(file="x.csv", **wrong)


def test_a_relative_file_lies_in_the_given_folder(file):
    settings = SpecimenSettings(file=file.name, discrepancies=("none",), noise_sd=1.0)
    assert run_specimen(settings, file.parent).experiment.name == "specimen"


def test_the_seed_decides_the_draws_and_nothing_else(file):
    one, two, other = (study(file, discrepancies=("none",), noise_sd=1.0, seed=seed).posteriors["none"]
                       for seed in (1, 1, 2))  # fmt: skip
    np.testing.assert_array_equal(one.solution.draws["C10"], two.solution.draws["C10"])
    assert not np.array_equal(one.solution.draws["C10"], other.solution.draws["C10"])
    assert one.solution.marginals["C10"].mean == other.solution.marginals["C10"].mean
