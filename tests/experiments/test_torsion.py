"""Twist and torque of a disc, against closed forms of the torque of laws whose stress in shear is known."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.errors import InputError
from tissuq.experiments.reading.read import read_experiment
from tissuq.experiments.reading.twisted_disc import apparent_stress, rim_stress
from tissuq.experiments.units import TORQUE
from written_files import message, written

RADIUS, HEIGHT = 10.0, 2.0  # mm
TWIST = np.linspace(0.0, 0.24, 61)  # rad
SHEAR = TWIST * RADIUS / HEIGHT
SIZES = {"diameter": "20 mm", "length": "2 mm"}


def mooney_rivlin(shear):
    """Return stress and torque of C10 = 20 kPa, C01 = 5 kPa: both are linear."""
    return 0.05 * shear, np.pi * RADIUS**3 / 2 * 0.05 * shear


def yeoh(shear):
    """Return tau = 2 (C10 g + 2 C20 g^3), and 2 pi (R/g)^3 times the integral of tau x^2."""
    stress = 2 * (0.02 * shear + 2 * 0.01 * shear**3)
    return stress, 4 * np.pi * RADIUS**3 * (0.02 * shear / 4 + 2 * 0.01 * shear**3 / 6)


def fung(shear, rate=1.5):
    """Return tau = mu g exp(b g^2), and the torque with the integral of g^3 exp(b g^2)."""
    square, not_zero = rate * shear**2, np.where(shear == 0, 1.0, shear)
    integral = ((square - 1) * np.exp(square) + 1) / (2 * rate**2)
    return 0.03 * shear * np.exp(square), 2 * np.pi * RADIUS**3 * 0.03 * integral / not_zero**3


LAWS = {"mooney-rivlin": (mooney_rivlin, 0.0), "yeoh": (yeoh, -0.19), "fung": (fung, -0.3)}


def of_disc(folder, names="Twist (rad),Torque (mN m)", twist=TWIST, torque=None):
    return written(folder, names, twist, mooney_rivlin(SHEAR)[1] if torque is None else torque, name="disc.csv")


@pytest.mark.parametrize("name", LAWS)
def test_the_stress_at_the_rim_is_that_of_the_law(name):
    law, bias = LAWS[name]
    stress, torque = law(SHEAR)
    apparent = apparent_stress(torque, RADIUS)
    np.testing.assert_allclose(rim_stress(SHEAR, apparent), stress, atol=0.003 * stress[-1])
    assert apparent[-1] / stress[-1] - 1 <= bias + 1e-12  # what a linear material would be taken for


@pytest.mark.parametrize("name", LAWS)
def test_noise_of_the_torque_is_not_made_much_larger(name):
    """The largest error of 20 curves with noise of half a percent stays below 5 % of the largest stress."""
    stress, torque = LAWS[name][0](SHEAR)
    apparent, random = apparent_stress(torque, RADIUS), np.random.default_rng(1)
    for _ in range(20):
        noisy = apparent + 0.005 * apparent[-1] * random.standard_normal(len(SHEAR))
        assert np.abs(rim_stress(SHEAR, noisy) - stress).max() < 0.05 * stress[-1]


def test_both_directions_are_one_odd_curve():
    shear = np.concatenate([-SHEAR[:0:-1], SHEAR])
    stress, torque = yeoh(shear)
    np.testing.assert_allclose(rim_stress(shear, apparent_stress(torque, RADIUS)), stress, atol=0.003 * stress[-1])


@pytest.mark.parametrize(
    ("names", "to_file"),
    [
        ("Twist (rad),Torque (mN m)", (1.0, 1.0)),
        ("Rotation [deg],Torque [N.m]", (180 / np.pi, 1e-3)),
        ("Drehwinkel [°],Drehmoment [mNm]", (180 / np.pi, 1.0)),
        ("Encoder (mrad),Torque (uN.m)", (1e3, 1e3)),
        ("angle de torsion (rad),couple (N·mm)", (1.0, 1.0)),
        ("q1 (rad),q2 (mN m)", (1.0, 1.0)),
    ],
)
def test_twist_and_torque_are_recognised_and_converted(tmp_path, names, to_file):
    stress, torque = fung(SHEAR)
    file = of_disc(tmp_path, names, TWIST * to_file[0], torque * to_file[1])
    data = read_experiment(file, mode="simple-shear", dimensions=SIZES)
    np.testing.assert_allclose(data.stretch, SHEAR, atol=1e-9)
    np.testing.assert_allclose(data.stress, stress, atol=0.003 * stress[-1])
    assert "(3 + d ln T / d ln g)/4" in data.source
    assert "R = 10 mm (half the diameter as given), H = 2 mm (as given)" in data.source


def test_twist_and_torque_leave_no_choice_of_the_mode(tmp_path):
    assert read_experiment(of_disc(tmp_path), dimensions=SIZES).mode.name == "simple-shear"


def test_the_stress_that_a_rheometer_states_is_corrected_where_it_is_said_to_be_of_a_disc(tmp_path):
    stress, torque = fung(SHEAR)
    file = of_disc(tmp_path, "Shear strain,Shear stress (kPa)", SHEAR, 1e3 * apparent_stress(torque, RADIUS))
    data = read_experiment(file, mode="simple-shear", stress_type="torsion")
    np.testing.assert_allclose(data.stress, stress, atol=0.003 * stress[-1])


def test_a_twist_that_does_not_begin_at_zero_is_asked_about(tmp_path):
    file = of_disc(tmp_path, twist=TWIST + 0.1)
    with pytest.raises(InputError, match="--zero first"):
        read_experiment(file, mode="simple-shear", dimensions=SIZES)
    for zero in ("first", "0.1 rad", "100 mrad"):
        data = read_experiment(file, mode="simple-shear", dimensions=SIZES, zero=zero)
        np.testing.assert_allclose(data.stretch, SHEAR, atol=1e-9)


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        ("Twist (rad),Torque (mN m)", {"mode": "simple-shear"}, "give its diameter"),
        ("Twist (rad),Torque (mN m)", {"mode": "simple-shear", "dimensions": {"diameter": "20 mm"}}, "length"),
        (
            "Twist (rad),Torque (mN m)",
            {"mode": "uniaxial"},
            "is a torque; if a disc was twisted, give --mode simple-shear",
        ),
        ("Twist,Torque (mN m)", {"mode": "simple-shear", "dimensions": SIZES}, "states no unit of angle"),
        ("Twist (rad),Torque", {"mode": "simple-shear", "dimensions": SIZES}, "states no unit of torque"),
        ("Twist (rad),Torque (mN m)", {"columns": {"twist": 1, "torque": 2}}, "give its diameter"),
        ("Strain,Shear stress (kPa)", {"stress_type": "torsion", "columns": {"stress": 2}}, "is for a twisted disc"),
        ("Shear,Normal force (N)", {"mode": "simple-shear"}, "is normal to the sheared planes"),
    ],
)
def test_what_is_missing_is_asked_for(tmp_path, names, options, words):
    assert words in message(of_disc(tmp_path, names), **options)


def test_a_torque_against_the_twist_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not have the sign of the twist"):
        read_experiment(of_disc(tmp_path, torque=-mooney_rivlin(SHEAR)[1]), mode="simple-shear", dimensions=SIZES)


@pytest.mark.parametrize(
    ("unit", "newton_mm"), [("N m", 1e3), ("mN.m", 1.0), ("µN·m", 1e-3), ("N-cm", 10.0), ("Nmm", 1.0)]
)
def test_units_of_torque(unit, newton_mm):
    assert TORQUE.factor(unit) == pytest.approx(newton_mm)


def test_a_rheometer_that_moves_its_gap_does_not_twist(tmp_path):
    gap, number = np.linspace(10.0, 8.0, 30), np.arange(30)
    columns = number * 1e-7, number * 1e-6, gap, number / 3
    path = written(tmp_path, "Encoder (rad),Torque (Nm),Gap (mm),Normal force (N)", *columns, name="gap.csv")
    data = read_experiment(path, dimensions={"diameter": "8 mm"}, compression_positive=True)
    assert data.mode.name == "uniaxial"
    np.testing.assert_allclose(data.stretch, gap / 10)
    path.write_text(path.read_text().replace("Encoder", "Twist"))
    assert read_experiment(path, dimensions={"diameter": "8 mm"}, compression_positive=True).mode.name == "uniaxial"


def rate_file(folder, header="Step time [s],Shear rate [1/s],Stress [Pa]", time=None):
    """A disc that is sheared faster and faster: an amount of shear of 0.01 t + 0.005 t^2 at the time t."""
    time = np.linspace(0, 4, 50) if time is None else time
    return written(folder, header, time, 0.01 * (1 + time), 500 * time, name="rate.csv")


def test_a_rate_of_shear_is_summed_over_time(tmp_path):
    time = np.linspace(0, 4, 50)
    data = read_experiment(rate_file(tmp_path), mode="simple-shear")
    np.testing.assert_allclose(data.stretch, 0.01 * time + 0.005 * time**2, atol=1e-6)
    minutes = rate_file(tmp_path, "t [min],Scherrate [1/min],Stress [Pa]")
    np.testing.assert_allclose(read_experiment(minutes, mode="simple-shear").stretch, data.stretch, atol=1e-12)
    assert "integral of column 'Scherrate [1/min]'" in read_experiment(minutes, mode="simple-shear").source


def test_a_rate_of_shear_without_a_time_that_goes_on_is_refused(tmp_path):
    with pytest.raises(InputError, match="0 columns are times"):
        read_experiment(rate_file(tmp_path, "Step,Shear rate [1/s],Stress [Pa]"), mode="simple-shear")
    with pytest.raises(InputError, match=r"line 4, column 'Step time .s.': the time goes back"):
        read_experiment(rate_file(tmp_path, time=np.array([0, 1, 0.5, 2, 3])), mode="simple-shear")


@pytest.mark.parametrize("options", [{"mean_of": 6}, {"columns": {"sem": "SEM (mN m)"}}])
def test_the_spread_of_torques_is_not_used_and_this_is_said(tmp_path, options):
    torque = mooney_rivlin(SHEAR)[1]
    file = written(tmp_path, "Twist (rad),Torque (mN m),SEM (mN m)", TWIST, torque, 0.01 * torque + 1)
    test = {"mode": "simple-shear", "dimensions": SIZES}
    assert any("column 'SEM (mN m)' is not used" in text for text in tq.inspect(file, **test).warnings)
    with pytest.raises(InputError, match=r"not for the torque of a disc. Leave it out"):
        tq.inspect(file, **test, **options)


@pytest.mark.parametrize("stress_type", [None, "engineering", "torsion"])
def test_a_torque_beside_the_stress_raises_a_note_until_the_type_of_stress_is_said(tmp_path, stress_type):
    shear = np.linspace(0.01, 0.5, 30)
    path = written(tmp_path, "Shear strain (%),Shear stress (Pa),Torque (mN m)", 100 * shear, 1000 * shear, shear)
    warnings = tq.inspect(path, mode="simple-shear", stress_type=stress_type).warnings
    assert any("--stress-type torsion, which corrects it" in text for text in warnings) is (stress_type is None)


@pytest.mark.parametrize(
    ("head", "is_disc"),
    [
        ("Geometry name\t20.0mm parallel plate, Peltier plate Stainless steel", True),
        ("Measuring System:\tPP25", True),
        ("Measuring System:\tcouette CC27", False),
        ("Supply\tPP25.4", False),
    ],
)
def test_a_disc_that_is_named_above_a_shear_stress_raises_the_note_without_a_torque(tmp_path, head, is_disc):
    rows = "".join(f"{g:.2f}\t{10 * g:.4f}\n" for g in np.linspace(1, 50, 30))
    (tmp_path / "shear.txt").write_text(f"{head}\nSample\tliver 3\nShear strain\tShear stress\n%\tPa\n{rows}")
    warnings = tq.inspect(tmp_path / "shear.txt", mode="simple-shear").warnings
    seen = [text for text in warnings if "--stress-type torsion, which corrects it" in text]
    assert len(seen) == is_disc
    assert all(f"line 1 says '{' '.join(head.split())}'" in text for text in seen)
