"""What a run predicts in any loading mode, and what it says of it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import tissuq as tq
from tissuq.assessment.stability import calibrated_range
from tissuq.experiments.modes import loading_mode
from tissuq.prediction import moments
from tissuq.report.specimen import specimen_result
from tissuq.report.writer import write_result
from tissuq.studies.predict_run import predicted, run_prediction
from tissuq.studies.run_settings import ComparedFile, PredictionSettings, stretches
from tissuq.studies.specimen import SpecimenSettings, run_specimen

TRUTH = {"C10": 0.4, "C20": 0.03, "C30": 0.002}
STRETCH = np.linspace(0.7, 1.6, 14)
NOISE_SD = 0.02


@pytest.fixture(scope="module")
def data():
    return tq.simulate("yeoh", TRUTH, STRETCH, noise_sd=NOISE_SD, seed=1)


@pytest.fixture(scope="module")
def fits(data):
    return {name: tq.fit(data, discrepancy=name, noise_sd=NOISE_SD) for name in ("auto", "constant", "none")}


@pytest.fixture(scope="module")
def planar():
    return tq.simulate("yeoh", TRUTH, np.linspace(1.05, 1.9, 8), noise_sd=NOISE_SD, mode="planar", seed=2)


@pytest.fixture(scope="module")
def run(data, tmp_path_factory):
    """A run of tissuq fit in kPa, of two discrepancies."""
    folder = tmp_path_factory.mktemp("prediction")
    file = folder / "specimen.csv"
    rows = [f"{a!r},{1000 * b!r}\n" for a, b in zip(data.stretch.tolist(), data.stress.tolist(), strict=True)]
    file.write_text("stretch,stress_kPa\n" + "".join(rows))
    settings = SpecimenSettings(file=str(file), discrepancies=("constant", "none"), noise_sd=1000 * NOISE_SD)
    study = run_specimen(settings)
    (folder / "run").mkdir()
    write_result(specimen_result(study), folder / "run", figures=False)
    return folder / "run"


def test_bands_are_those_of_the_posterior(fits):
    found = predicted(fits["auto"], mode="planar", stretch=[0.9, 1.2, 1.4], prob=0.8)
    for kind in (True, False):
        for noise in (True, False):
            own = fits["auto"].predict([0.9, 1.2, 1.4], mode="planar", discrepancy=kind, noise=noise, prob=0.8)
            assert found.bands[0, kind, noise].equals(own)
    table = found.table
    assert table["low [MPa]"].tolist() == found.bands[0, True, False]["low"].tolist()
    assert table["alone_predictive_high [MPa]"].tolist() == found.bands[0, False, True]["high"].tolist()
    assert (table["predictive_high [MPa]"] >= table["high [MPa]"]).all()


def test_the_usual_stretches_are_the_calibrated_ones(fits, data):
    found = predicted(fits["none"], mode="planar", points=7)
    ends = calibrated_range(fits["none"].model, loading_mode("planar"))
    np.testing.assert_allclose(found.points, np.linspace(*ends, 7), rtol=1e-12)
    assert found.is_calibrated.all()
    assert not found.warnings
    assert predicted(fits["none"], points=7).mode.name == "uniaxial"


def test_beside_data_the_stretches_reach_to_them_and_no_further_than_rest_on_the_other_side(fits, planar, data):
    found = predicted(fits["none"], data=planar)
    assert found.mode.name == "planar"
    assert found.points[0] == 1.0
    _, high = calibrated_range(fits["none"].model, loading_mode("planar"))
    assert found.points[-1] == max(planar.stretch.max(), high)


def test_what_is_beyond_the_data_is_marked_and_told_once(fits, data, planar):
    found = predicted(fits["none"], mode="planar", stretch=[0.5, 1.0, 1.3, 3.0], data=planar)
    low, high = calibrated_range(fits["none"].model, loading_mode("planar"))
    assert found.is_calibrated.tolist() == [False, True, True, False]
    assert found.table["is_calibrated"].tolist() == found.is_calibrated.tolist()
    (told,) = [text for text in found.warnings if "calibrated" in text]
    outside = int((planar.stretch > high).sum())
    assert told.startswith(f"2 of 4 points and {outside} of 8 measurements lie outside the measured range")
    assert f"from {low:.4g} to {high:.4g}" in told
    assert found.is_data_calibrated.sum() == 8 - outside


def test_beyond_the_stretches_of_a_mode_it_is_told_where_the_invariants_are_within_those_of_the_tests(data):
    """Uniaxial compression to 0.6 has the invariants of equibiaxial tension to 1 / sqrt(0.6) = 1.29."""
    options = {"noise_sd": 1e-5, "seed": 2}
    tests = [
        tq.simulate("neo-hookean", {"C10": 1e-3}, np.linspace(1, 1.4, 8), mode=mode, **options)
        for mode in ("uniaxial", "equibiaxial")
    ]
    posterior = tq.fit(tests, discrepancy="taylor", noise_sd=1e-5, tolerances="as-tested")
    within, beyond = (predicted(posterior, mode="uniaxial", stretch=[end, 1.0, 1.4]) for end in (0.6, 0.4))
    assert "I1 and I2 are no larger beyond it than in the tests of the run" in within.warnings[0]
    assert "is due to how the energy goes on" in beyond.warnings[0]


def test_the_share_of_the_variance_beyond_the_data_is_that_of_the_errors_of_their_exponents(fits, monkeypatch):
    """The band is the same where these errors are taken to be their medians, and the share follows from both widths."""
    stretches = [1.2, 3.0, 4.0]
    found = predicted(fits["auto"], stretch=stretches)
    monkeypatch.setattr(moments, "scores", np.zeros_like)
    band, without = found.curves[0, True, False], predicted(fits["auto"], stretch=stretches).curves[0, True, False]
    np.testing.assert_allclose(without.high[0], band.high[0], rtol=1e-14)  # a rounding error on some processors
    expected = 1 - ((without.high - without.low) / (band.high - band.low)) ** 2
    np.testing.assert_allclose(found.extrapolated[0], expected, rtol=1e-9, atol=1e-12)
    assert found.extrapolated[0][0] == 0
    assert (found.extrapolated[0][1:] > 0.01).all()
    assert found.table["extrapolated"].tolist() == found.extrapolated[0].tolist()
    assert (
        f"up to {100 * expected.max():.0f} % of the variance of the stress is due to how the energy goes on"
        in found.warnings[0]
    )


def test_an_error_of_the_stress_is_left_out_elsewhere_and_that_is_said(fits):
    found = predicted(fits["constant"], mode="planar", stretch=[1.2])
    assert found.kinds == (False,)
    assert any("does not apply to the planar stress" in text for text in found.warnings)
    assert "median [MPa]" not in found.table
    own = predicted(fits["constant"], stretch=[1.2])
    assert own.kinds == (True, False)
    assert not own.warnings


def test_without_a_discrepancy_there_is_one_prediction(fits):
    assert predicted(fits["none"], stretch=[1.2]).kinds == (False,)


@pytest.mark.slow
def test_measurements_are_scored_with_the_discrepancy_and_without(fits, planar):
    found = predicted(fits["auto"], data=planar)
    expected = fits["auto"].scores(planar, discrepancy=False)
    own = found.scores[found.scores["discrepancy"] == "without"]
    assert own["crps"].tolist() == expected["crps"].tolist()
    assert set(found.scores["discrepancy"]) == {"with", "without"}


def test_a_reader_is_told_what_the_comparison_cannot_say(fits, data, planar):
    assert any("--estimand tissue" in text for text in predicted(fits["none"], data=planar).warnings)
    (only,) = predicted(fits["none"], data=data).warnings
    assert "fitted to these measurements" in only
    tolerant = tq.fit(data, discrepancy="none", noise_sd=NOISE_SD, tolerances=tq.Tolerances(stress=0.1))
    assert not any("--estimand" in text for text in predicted(tolerant, data=planar).warnings)


def test_labelled_arrays_hold_every_band_with_its_unit(fits, planar, tmp_path):
    found = predicted(fits["auto"], data=planar, stretch=[1.1, 1.3])
    found.save(tmp_path / "prediction.nc")
    read = xr.open_dataset(tmp_path / "prediction.nc", engine="h5netcdf")
    assert dict(read.sizes) == {"discrepancy": 2, "noise": 2, "stress": 1, "stretch": 2, "measurement": 8}
    own = read["high"].sel(discrepancy="without", noise="with", stretch=1.3).values
    assert own == [found.bands[0, False, True]["high"][1]]
    assert (
        read["median"].sel(discrepancy="with", noise="without").values[0].tolist()
        == found.bands[0, True, False]["median"].tolist()
    )
    assert {read[name].attrs["units"] for name in ("median", "low", "high", "measured")} == {"MPa"}
    assert read["stretch"].attrs["units"] == "1"
    assert read.attrs["loading_mode"] == "planar"


def test_cauchy_stress_is_the_engineering_stress_times_the_stretch(fits, planar):
    one, other = (
        predicted(fits["none"], data=planar, stretch=[1.5], stress_type=each) for each in ("engineering", "cauchy")
    )
    np.testing.assert_allclose(other.table["alone_high [MPa]"], 1.5 * one.table["alone_high [MPa]"], rtol=1e-12)
    np.testing.assert_allclose(other.measured(0), planar.stretch * planar.stress, rtol=1e-12)
    assert other.stresses == ("Cauchy stress",)


def test_a_mode_of_two_controls_has_a_band_for_each_stress_equal_where_stretches_are(fits):
    points = np.column_stack([np.linspace(1, 1.3, 4), np.full(4, 1.1)])
    found = predicted(fits["auto"], mode="biaxial", stretch=points)
    table = found.table
    assert len(table) == 8
    assert table["stretch2"].unique().tolist() == [1.1]
    equal = predicted(fits["auto"], mode="biaxial", stretch=[[1.2, 1.2]]).table["median [MPa]"]
    assert equal[0] == pytest.approx(equal[1], rel=1e-9)
    single = fits["auto"].predict([1.2], mode="equibiaxial", noise=False)["median"][0]
    assert equal[0] == pytest.approx(single, rel=1e-6)
    assert found.data_set["low"].dims == ("discrepancy", "noise", "stress", "point")


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["constrained-uniaxial", "simple-shear-normal"])
def test_a_mode_of_one_control_and_two_stresses_is_predicted_where_calibrated(fits, mode):
    found = predicted(fits["auto"], mode=mode, points=5)
    assert found.is_calibrated.all()
    assert len(found.table) == 10


@pytest.mark.slow
def test_measurements_of_two_controls_are_predicted_where_they_are(fits):
    test = tq.simulate("yeoh", TRUTH, [[1.1, 1.0], [1.1, 1.2], [1.3, 1.2]], noise_sd=NOISE_SD, mode="biaxial", seed=1)
    found = predicted(fits["auto"], data=test)
    np.testing.assert_array_equal(found.points, test.stretch)
    with pytest.raises(tq.InputError, match="not both"):
        predicted(fits["auto"], data=test, stretch=test.stretch)
    with pytest.raises(tq.InputError, match="has several controls"):
        predicted(fits["auto"], mode="biaxial")


def test_of_several_modes_one_must_be_chosen(data, planar):
    both = tq.fit([data, planar], discrepancy="constant", noise_sd=NOISE_SD)
    with pytest.raises(tq.InputError, match="in several modes"):
        predicted(both)
    found = predicted(both, mode="planar", points=3)
    assert found.kinds == (True, False)
    assert found.points[-1] == planar.stretch.max()


def test_what_cannot_be_compared_is_refused(fits, data, planar):
    with pytest.raises(tq.InputError, match="are of mode planar, but the predicted mode is equibiaxial"):
        predicted(fits["none"], mode="equibiaxial", data=planar)
    with pytest.raises(tq.InputError, match="several tests"):
        predicted(fits["none"], data=tq.fit([data, planar], discrepancy="none").model.experiment)


def test_a_stress_beyond_all_numbers_is_refused(fits):
    with pytest.raises(tq.ModelError, match="overflows at a stretch of 1e\\+160"):
        predicted(fits["auto"], mode="equibiaxial", stretch=[1.1, 1e160])


def test_a_run_predicts_as_its_fit_does(run, data):
    found = tq.predict_run(run, "constant", stretch=[0.8, 1.2])
    direct = tq.fit(data, discrepancy="constant", noise_sd=NOISE_SD).predict([0.8, 1.2], unit="kPa")
    np.testing.assert_allclose(found.bands[0, True, True].to_numpy(), direct.to_numpy(), rtol=1e-6)
    assert found.unit.name == "kPa"


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1:2", [1.0, 1.5, 2.0]), ("-0.2:0.2", [-0.2, 0.0, 0.2]), ("1.1, 1.3", [1.1, 1.3]), ("2", [2.0])],
)
def test_texts_say_stretches(text, expected):
    np.testing.assert_allclose(stretches(text, points=3), expected, atol=1e-15)


@pytest.mark.parametrize("text", ["110:130", "105, 110"])
def test_stretches_in_percent_are_refused(text):
    with pytest.raises(tq.InputError, match=r"begins at 1.*: write stretches"):
        stretches(text)


@pytest.mark.parametrize("text", ["", "a", "1:", ":2", "2:1", "1:1", "1:2:3", "1,,2", "0.7-2", "nan", "1:inf"])
def test_other_texts_are_refused(text):
    with pytest.raises(tq.InputError, match="is not a range or list of stretches"):
        stretches(text)


@pytest.mark.parametrize(
    ("mode", "stretch", "stretch2", "words"),
    [
        ("planar", "1:2", "1", "has one control"),
        ("biaxial", "1:2", None, "give --at, and also --at2"),
        ("biaxial", None, "1:2", "give --at, and also --at2"),
        ("biaxial", "1,2,3", "1,2", "3 values and --at2 2"),
    ],
)
def test_every_control_needs_its_values(mode, stretch, stretch2, words):
    with pytest.raises(tq.InputError, match=words):
        PredictionSettings(run="run", stretch=stretch, stretch2=stretch2).points_of(mode)


def test_an_axis_is_held_or_goes_along():
    held = PredictionSettings(run="run", stretch="1:2", stretch2="1.1", points=3).points_of("biaxial")
    assert held.tolist() == [[1.0, 1.1], [1.5, 1.1], [2.0, 1.1]]
    along = PredictionSettings(run="run", stretch="1:2", stretch2="1:1.4", points=3).points_of("biaxial")
    np.testing.assert_allclose(along, [[1.0, 1.0], [1.5, 1.2], [2.0, 1.4]])


def test_a_file_says_its_mode(run, tmp_path):
    file = tmp_path / "other.csv"
    file.write_text("# mode: planar\nstretch,stress_kPa\n1.1,210\n1.2,380\n")
    settings = PredictionSettings(run=str(run), discrepancy="none", data=ComparedFile(file=str(file)), points=3)
    found = run_prediction(settings)
    assert found.mode.name == "planar"
    np.testing.assert_allclose(found.data.stress, [0.21, 0.38], rtol=1e-12)
    with pytest.raises(tq.InputError, match="measured in mode planar, but mode equibiaxial"):
        run_prediction(settings.model_copy(update={"mode": "equibiaxial"}))
