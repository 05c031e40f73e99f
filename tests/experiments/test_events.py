import itertools
import re

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.experiments import datasets
from tissuq.experiments.reading.disturbances import ends_of_rests, find_holds, find_rupture
from written_files import check_curve, text_file, written

LAWS = {
    "neo-hookean": lambda share: 1.4 * share - (1.4 * share) ** 2 / 3,
    "straight": lambda share: share,
    "softening": lambda share: -np.expm1(-3 * share),
    "stiffening": lambda share: np.expm1(5 * share),
}


def loading(random, law):
    """A branch of loading in tension or compression with noise up to 1 %: stretches, stresses, standard deviation."""
    share = np.linspace(0, 1, int(random.choice([40, 100, 200, 1000])))
    sign, noise = random.choice([1, -1]), random.choice([0, 1e-3, 1e-2])
    stress = LAWS[law](share) / LAWS[law](1.0)
    stretch = 1 + sign * random.uniform(0.1, 0.45) * share
    return stretch, sign * (stress + noise * random.standard_normal(len(share))), noise


def torn(random, law):
    """Loading, at whose end the specimen tears at once, slowly, or by a half."""
    stretch, stress, noise = loading(random, law)
    count = max(4, int(len(stretch) * random.uniform(0.05, 0.4)))
    further = stretch[-1] + (stretch[1] - stretch[0]) * np.arange(1, count + 1)
    left = {"at once": 0.02, "slowly": 0.1, "by a half": 0.5}[how := random.choice(["at once", "slowly", "by a half"])]
    course = np.clip(np.arange(1, count + 1) / (count / 2 if how == "slowly" else 1), 0, 1)
    after = stress[-1] * (1 - (1 - left) * course) + noise * random.standard_normal(count)
    return np.concatenate([stretch, further]), np.concatenate([stress, after])


def held(random, law, then_back):
    """Loading, a hold in which the stress relaxes by 12 to 50 %, and perhaps the way back."""
    stretch, stress, noise = loading(random, law)
    count, loss = max(12, int(len(stretch) * random.uniform(0.2, 2))), random.uniform(0.12, 0.5)
    rest = stretch[-1] + random.choice([0, 1e-3]) * np.ptp(stretch) * random.standard_normal(count)
    relaxing = stress[-1] * (1 - loss * -np.expm1(-np.linspace(0, 5, count)))
    relaxing = relaxing + noise * random.standard_normal(count)
    back = slice(-2, None if then_back else -2, -1)
    return np.concatenate([stretch, rest, stretch[back]]), np.concatenate([stress, relaxing, (1 - loss) * stress[back]])


def returning(random, law):
    """Triangles or waves with hysteresis, or a branch alone."""
    stretch, stress, _ = loading(random, law)
    how = random.choice(["branch", "triangles", "waves"])
    if how == "triangles":
        stretch, stress = (np.tile(np.concatenate([v, w * v[-2:0:-1]]), 2) for v, w in ((stretch, 1), (stress, 0.8)))
    if how == "waves":
        phase = np.linspace(0, 2 * np.pi * random.integers(1, 5), 400)
        stretch = 1.2 - 0.2 * np.cos(phase)
        stress = LAWS[law]((stretch - 1) / 0.4) / LAWS[law](1.0) + 0.05 * np.sin(phase)
    return stretch, stress


def test_rupture_is_found_in_95_of_100_planted_cases():
    """All of 600 are found."""
    random = np.random.default_rng(1)
    assert np.mean([find_rupture(*torn(random, law)) is not None for law in list(LAWS) * 50]) >= 0.95


def test_holds_are_found_in_95_of_100_planted_cases():
    """Of 600 with relaxation by 10 to 50 % 99 % are found."""
    random = np.random.default_rng(2)
    planted = [held(random, law, then_back) for law in list(LAWS) * 25 for then_back in (False, True)]
    assert np.mean([bool(find_holds(*curve)) for curve in planted]) >= 0.95


@pytest.mark.slow
def test_clean_curves_raise_no_more_than_5_of_100_false_alarms():
    random = np.random.default_rng(3)
    curves = [returning(random, law) for law in list(LAWS) * 50]
    branches = [loading(random, law)[:2] for law in list(LAWS) * 50]
    assert np.mean([bool(find_holds(*curve)) for curve in curves]) <= 0.05
    assert np.mean([find_rupture(*branch) is not None for branch in branches]) <= 0.05


@pytest.mark.parametrize("name", datasets.names())
def test_the_data_sets_show_neither(name):
    notes = tq.inspect(datasets.path(name), mode=datasets.load(name).mode).warnings
    assert not any("--until-peak" in note or "relaxes" in note for note in notes)


@pytest.mark.parametrize("rows", [200, 50_000])
def test_strong_noise_is_neither_and_hides_no_rupture(rows):
    random, share = np.random.default_rng(4), np.linspace(0, 1.2, rows)
    noise = 0.05 * random.standard_normal(rows)
    whole, torn_at_end = share + noise, np.where(share < 1, share, 0.05) + noise
    assert find_rupture(1 + share, whole) is None
    assert find_holds(1 + share, whole) == []
    rupture = find_rupture(1 + share, torn_at_end)
    assert rupture is not None
    assert share[rupture.start] == pytest.approx(1.0, abs=0.1)


def test_a_single_outlier_is_no_rupture():
    stretch = np.linspace(1, 1.4, 50)
    stress = neo_hookean(stretch)
    stress[30] = 0.0
    assert find_rupture(stretch, stress) is None


@pytest.fixture
def inspected(tmp_path):
    def inspect(stretch, stress, **options):
        path = written(tmp_path, "stretch,stress [MPa]", stretch, stress, form="{:.6f}".format)
        return tq.inspect(path, **options)

    return inspect


def up(rows=60, top=1.4):
    stretch = np.linspace(1, top, rows)
    return stretch, neo_hookean(stretch)


def test_a_rupture_is_said_and_the_advice_leaves_it_out(inspected):
    (stretch, stress), more = up(), np.linspace(1.41, 1.6, 20)
    curve = np.concatenate([stretch, more]), np.concatenate([stress, np.full(20, 0.001)])
    (note,) = inspected(*curve).warnings
    assert note.startswith("after line 61 (stretch 1.4) the stress falls by 97 % of the largest while the test goes on")
    assert "--until-peak" in note
    inspection = inspected(*curve, until_peak=True)
    assert inspection.warnings == ()
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch, atol=1e-6)
    assert "only rows up to the largest stress, in line 61" in inspection.steps
    assert "20 dropped: after the largest stress" in str(inspection)


def test_a_slip_after_which_more_is_borne_is_said_and_takes_no_part_in_slack(inspected):
    """Noise of 0.4 %, three tenths lost half-way; `--until-peak` would leave nothing out, so it is not proposed."""
    stretch, stress = up(rows=200)
    noise = 4e-3 * stress[-1] * np.random.default_rng(5).standard_normal(200)
    stress = np.where(np.arange(200) < 100, 1, 0.7) * stress + noise
    (note,) = inspected(stretch, stress).warnings
    assert note.startswith("after line 101 (stretch 1.199)")
    assert note.endswith("to leave them out give --leave-out 102:201.")
    inspection = inspected(stretch, stress, leave_out="102:201")
    assert inspection.warnings == ()
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch[:100], atol=1e-6)
    assert "100 dropped: in lines to leave out" in str(inspection)


def test_a_hold_is_said_and_the_advice_leaves_it_out(inspected):
    (stretch, stress), left = up(), 1 - 0.3 * -np.expm1(-np.linspace(0, 5, 41)[1:])
    curve = np.concatenate([stretch, np.full(40, 1.4)]), np.concatenate([stress, left * stress[-1]])
    (note,) = inspected(*curve).warnings
    assert note.startswith("in lines 61:101 the stretch rests while the stress falls by up to 28 % of the largest")
    assert "--until-peak" in note
    inspection = inspected(*curve, until_peak=True)
    assert inspection.warnings == ()
    np.testing.assert_allclose(inspection.reading.experiment.stretch, stretch, atol=1e-6)


def test_holds_before_the_largest_stress_are_said_with_their_lines(inspected):
    left, steps = 1 - 0.3 * -np.expm1(-np.linspace(0, 5, 40)), [1.1, 1.2, 1.3, 1.4]
    starts = [1.0, *steps[:-1]]
    stretch = np.concatenate([[*np.linspace(a, b, 10), *[b] * 40] for a, b in zip(starts, steps, strict=True)])
    stress = np.concatenate([[*np.linspace(neo_hookean(a), neo_hookean(b), 10), *neo_hookean(b) * left]
                             for a, b in zip(starts, steps, strict=True)])  # fmt: skip
    (note,) = inspected(stretch, stress).warnings
    assert all(f"{start}:" in note.partition(" the stretch rests")[0] for start in (11, 61, 111, 161))
    inspection = inspected(stretch, stress, leave_out=re.search(r"--leave-out (\S+)\.$", note)[1])
    assert inspection.warnings == ()
    assert len(inspection.reading.experiment) == 33


def in_steps(count, ramp, hold, noise=0.0, seed=4):
    """Stretches of a test in steps, and the last row of every one."""
    levels = np.linspace(1, 1.5, count + 1)
    ramps = [[*np.linspace(a, b, ramp + 1)[1:], *[b] * hold] for a, b in itertools.pairwise(levels)]
    stretch = np.concatenate(ramps)
    random = np.random.default_rng(seed)
    return stretch + noise * np.ptp(stretch) * random.standard_normal(len(stretch)), np.cumsum(
        [ramp + hold] * count
    ) - 1


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
@pytest.mark.parametrize(
    ("count", "ramp", "hold"),
    [(1, 50, 100), (5, 30, 200), (10, 3, 50), (10, 200, 100), (20, 50, 50), (30, 10, 20), (10, 3000, 9000), (6, 1, 10)],
)
def test_every_rest_of_a_test_in_steps_is_found_with_its_last_rows(count, ramp, hold, noise):
    stretch, ends = in_steps(count, ramp, hold, noise)
    rests = ends_of_rests(stretch)
    assert len(rests) == count
    assert (np.abs(rests - ends) <= max(1, 0.1 * hold)).all()


@pytest.mark.parametrize("stretch", [np.linspace(1, 1.5, 1000), np.tile(np.r_[1:1.5:200j, 1.5:1:200j], 3), np.ones(1)])
def test_nothing_rests_where_a_test_goes_on(stretch):
    assert not len(ends_of_rests(stretch))


def test_the_relaxed_stress_of_a_test_in_steps_is_read_as_the_message_says(inspected):
    stretch, ends = in_steps(5, 20, 100)
    since = np.tile(np.r_[np.zeros(20), np.linspace(0, 6, 100)], 5)
    curve = stretch, neo_hookean(stretch) * (1 + 0.4 * np.exp(-since))
    (note,) = inspected(*curve).warnings
    assert "to use the relaxed stress of each step give --relaxed; to leave them out give --leave-out " in note
    inspection = inspected(*curve, relaxed=True)
    assert inspection.warnings == ("the measurements begin at stretch 1.1, not near 1.",)
    experiment = inspection.reading.experiment
    check_curve(experiment, stretch[ends], neo_hookean(stretch[ends]) * (1 + 0.4 * np.exp(-6)), atol=1e-6)
    assert "only the last row of each of 5 rests" in inspection.steps
    assert "595 dropped: not the last of a rest" in str(inspection)


def test_a_test_without_rest_has_no_relaxed_stress(inspected):
    with pytest.raises(tq.InputError, match=r"the stretch rests nowhere.*Leave out relaxed=True \(--relaxed\)"):
        inspected(*up(), relaxed=True)


def test_until_peak_goes_with_a_cycle_and_a_preload(inspected):
    stretch, stress = up()
    curve = np.concatenate([stretch, stretch[-2::-1]]), np.concatenate([stress, 0.9 * stress[-2::-1]])
    experiment = inspected(*curve, until_peak=True, cycle=1, preload="1 kPa").reading.experiment
    assert experiment.stretch.min() >= 1.0
    assert experiment.stress.argmax() == len(experiment) - 1
    assert experiment.stress.min() >= 0.001


def test_a_stress_that_rests_while_the_specimen_deforms_is_in_doubt(tmp_path):
    rows = [f"{10 + np.log1p(t):.4f},{5 + 0.01 * np.sin(t):.4f}" for t in range(40)]
    path = text_file(tmp_path / "creep.csv", "Strain (%),Stress (kPa)", *rows)
    text = " ".join(str(tq.inspect(path)).split())
    assert (
        "the stress stays between 4.99 and 5.01 kPa while the stretch goes from 1.1 to 1.137: the specimen creeps"
        in text
    )
    assert "creeps" not in str(tq.inspect(datasets.path("rubber-treloar-uniaxial")))
