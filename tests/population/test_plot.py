import matplotlib.pyplot as plt
import numpy as np
import pytest

import tissuq as tq
from tissuq.drawing.panels import panels
from tissuq.experiments.units import stress_unit
from tissuq.population.answer import headline
from tissuq.population.picture import draw_specimens
from tissuq.report.population_figures import headline_figure


@pytest.fixture(scope="module")
def population():
    stretch, moduli = np.linspace(0.8, 1.3, 8), {"a": 0.4, "b": 0.5, "c": 0.6, "d": 0.7, "e": 0.45, "f": 0.55}
    specimens = {
        name: tq.simulate("neo-hookean", {"C10": modulus}, stretch, 0.01, seed=seed).labelled(stress_unit="kPa")
        for seed, (name, modulus) in enumerate(moduli.items())
    }
    return tq.fit_population(specimens, discrepancy="none", noise_sd=0.01)


@pytest.mark.slow
def test_every_specimen_is_a_row_with_its_intervals_in_the_unit_of_the_measurements(population):
    figure, given = plt.subplots()
    axis = population.plot(given)
    assert axis is given
    assert plt.get_fignums() == [figure.number]
    table = population.specimen_summary(unit="MPa").xs("C10", level="parameter").sort_values("median")
    assert [label.get_text() for label in axis.get_yticklabels()] == list(table.index)
    bars = [line.get_xdata() for line in axis.lines if line.get_marker() == "None"]
    ends = [table[[f"{prefix}hdi_low", f"{prefix}hdi_high"]].to_numpy() for prefix in ("alone_", "")]
    np.testing.assert_allclose(bars, 1000 * np.concatenate(ends))
    assert axis.get_xlabel() == "C10 [kPa]"
    plt.close(figure)


@pytest.mark.slow
def test_the_head_of_a_page_draws_the_modulus_which_is_twice_c10(population):
    assert headline(population) == ("initial shear modulus", 2.0)
    (axis,) = headline_figure(population, stress_unit("kPa")).axes
    table = population.specimen_summary(unit="MPa").xs("C10", level="parameter").sort_values("median")
    bars = [line.get_xdata() for line in axis.lines if line.get_marker() == "None"]
    ends = [table[[f"{prefix}hdi_low", f"{prefix}hdi_high"]].to_numpy() for prefix in ("alone_", "")]
    np.testing.assert_allclose(bars, 2000 * np.concatenate(ends))
    assert axis.get_xlabel() == "initial shear modulus [kPa]"


@pytest.mark.slow
def test_a_notebook_shows_the_population_in_the_unit_of_the_measurements(population):
    page = population._repr_html_()
    summary = population.summary(unit="MPa")["median"]
    assert "stresses in kPa" in page
    assert f"<td>{1000 * summary['C10', 'median']:.4g}</td>" in page
    assert f"<td>{summary['C10', 'spread']:.4g}</td>" in page  # sd of a logarithm
    assert not plt.get_fignums()


@pytest.mark.slow
def test_a_new_patient_is_drawn_as_predicted_for_measurements_that_were_not_fitted(population):
    axis = population.patient.plot()
    assert axis.get_title(loc="left") == "predicted, not fitted to these"
    plt.close(axis.figure)


def drawn_axis(rows, medians, width, unit):
    """The axis of a population of one parameter, from its quantities with intervals and its specimens' medians."""
    import pandas as pd

    ends = ["median", "hdi_low", "hdi_high"]
    summary = pd.DataFrame.from_dict({("C10", name): row for name, row in rows.items()}, "index", columns=ends)
    summary.index = pd.MultiIndex.from_tuples(summary.index)
    specimens = pd.DataFrame.from_dict(
        {(name, "C10"): [m, (1 - width) * m, (1 + width) * m] * 2 for name, m in medians.items()},
        "index", columns=[*ends, *(f"alone_{end}" for end in ends)],
    )  # fmt: skip
    specimens.index = pd.MultiIndex.from_tuples(specimens.index)
    with panels(plt.subplots()[1], 1) as drawn:
        draw_specimens(drawn, summary, specimens, {"C10": unit})
    (axis,) = drawn.axes
    return axis


def test_the_axis_is_that_of_most_specimens_and_says_what_lies_outside():
    rows = {
        "median": [0.5, 0.4, 0.6],
        "spread": [1, 0.5, 2],
        "new specimen": [0.5, 0.1, 9],
        "complete pooling": [0.5005, 0.499, 0.501],
    }
    axis = drawn_axis(rows, {"a": 0.4, "b": 0.5, "c": 0.6, "d": 0.45, "stiff": 30.0}, 0.1, "MPa")
    low, high = axis.get_xlim()
    assert 0.1 < low < 0.36
    assert 0.66 < high < 1
    assert {text.get_text() for text in axis.texts} == {"30 [27, 33]", "a new specimen: from 0.1 to 9"}
    complete = [line for line in axis.lines if line.get_marker() == "D"]
    level = next(text.get_position()[1] for text in axis.texts if text.get_text().startswith("a new specimen"))
    assert axis.get_ylim()[0] < level < complete[0].get_ydata().item()  # beneath it, not on it
    assert [line.get_xdata().item() for line in complete] == [0.5005]  # seen however narrow its interval
    plt.close("all")


def test_intervals_that_are_far_wider_than_medians_are_apart_end_within_the_axis():
    rows = {name: [8.0, 7.0, 9.0] for name in ("median", "spread", "new specimen", "complete pooling")}
    axis = drawn_axis(rows, {"a": 7.9, "b": 8.0, "c": 8.02, "d": 8.1}, 0.08, "kPa")
    low, high = axis.get_xlim()
    assert low < 0.92 * 7.9 < 1.08 * 8.1 < high
    plt.close("all")


def test_specimens_that_differ_by_orders_of_magnitude_are_on_a_logarithmic_axis():
    rows = {name: [5.0, 0.1, 200.0] for name in ("median", "spread", "new specimen", "complete pooling")}
    axis = drawn_axis(rows, {f"S{m}": m for m in (0.2, 0.9, 3.1, 10.0, 41.0, 160.0)}, 0.01, "kPa")
    low, high = axis.get_xlim()
    assert axis.get_xscale() == "log"
    assert 0 < low < 0.2 < 160 < high
    assert not axis.texts  # nothing is outside
    assert {line.get_marker() for line in axis.lines} == {"None", "|", "D"}  # ticks hide no bar
    plt.close("all")
