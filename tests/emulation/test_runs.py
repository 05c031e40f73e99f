"""Forward models as users give them, and their runs: kept, gone on with, and told where they fail."""

import json
import sys
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

import tissuq as tq
from forward_models import DEPTH, neo_hooke
from tissuq.emulation import FileForward, gathered
from tissuq.emulation.forward import CallableForward, SeveralModels, UnreadableError, as_forward
from tissuq.emulation.problem import pose
from tissuq.emulation.runs import ForwardRun, carry_out
from tissuq.errors import ConvergenceError, InputError
from tissuq.studies.calibrate import runs_of

PRIORS = {"C10": tq.Uniform(0.2, 5.0)}
PROBLEM = pose(DEPTH, neo_hooke({"C10": 1.0}), PRIORS)
POINTS = np.array([[1.0], [2.0], [3.0]])


def silent(label, is_new):
    pass


@pytest.mark.parametrize(
    "function",
    [
        lambda parameters: neo_hooke(parameters),
        lambda parameters, control: 2 * parameters["C10"] * ((1 - control) ** -2 - (1 - control)),
        lambda parameters, control=None: 2 * parameters["C10"] * ((1 - control) ** -2 - (1 - control)),
        lambda parameters, factor=1.0: factor * neo_hooke(parameters),
    ],
)
def test_a_function_gets_the_parameters_and_the_controls_where_it_takes_them(function):
    found = as_forward(function).run({"C10": 1.5}, DEPTH)
    np.testing.assert_allclose(found, neo_hooke({"C10": 1.5}))


def test_a_function_in_a_file_is_run_from_there(tmp_path):
    file = tmp_path / "cube.py"
    file.write_text("def force(parameters, depth):\n    return parameters['k'] * depth\n")
    forward = FileForward(f"{file}:force")
    np.testing.assert_allclose(forward.run({"k": 2.0}, DEPTH), 2 * DEPTH)
    before = forward.identity
    file.write_text("def force(parameters, depth):\n    return 2 * parameters['k'] * depth\n")
    assert forward.identity != before


class Scaled:
    def __init__(self, factor, area=1.0):
        self.factor, self.area = factor, np.array([area])

    def __call__(self, parameters, depth):
        return self.factor * self.area[0] * parameters["C10"] * depth

    def force(self, parameters, depth):
        return self(parameters, depth)


@dataclass(frozen=True, slots=True)
class Slotted:
    factor: float

    def __call__(self, parameters, depth):
        return self.factor * parameters["C10"] * depth


def scaled(parameters, depth, factor=1.0):
    return factor * parameters["C10"] * depth


FACTOR = 2.0


def of_the_module(parameters, depth):
    return [part + 0.0 for part in within(parameters, depth)]


def within(parameters, depth):
    return FACTOR * parameters["C10"] * depth


@pytest.mark.parametrize(
    "made",
    [
        Scaled,
        Slotted,
        lambda factor: Scaled(1.0, area=factor),
        lambda factor: Scaled(factor).force,
        lambda factor: partial(scaled, factor=factor),
        lambda factor: lambda parameters, depth: scaled(parameters, depth, factor),
        lambda factor: lambda parameters, depth, factor=factor: scaled(parameters, depth, factor),
    ],
)
def test_the_runs_of_a_function_with_other_values_around_it_are_not_taken(made, tmp_path):
    """Of the model with half the stiffness; the parameter was that of the runs in the folder, twice too small."""
    options = {"discrepancy": "none", "noise_sd": 0.01, "runs": 8, "folder": tmp_path / "runs"}
    measured = 2 * DEPTH
    found = [tq.calibrate(DEPTH, measured, made(2.0), PRIORS, **options) for _ in range(2)]
    assert found[0].marginals["C10"].mean == found[1].marginals["C10"].mean
    with pytest.raises(InputError, match="another forward model"):
        tq.calibrate(DEPTH, measured, made(1.0), PRIORS, **options)


def test_the_values_of_the_module_are_part_of_a_function(monkeypatch):
    before = as_forward(of_the_module).identity
    assert as_forward(of_the_module).identity == before
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 3.0)
    assert as_forward(of_the_module).identity != before


NOTES = {}
SETTINGS = {"factor": 2.0}


def noting(parameters, depth):
    key = parameters["C10"]
    if key not in NOTES:
        NOTES[key] = SETTINGS["factor"] * parameters["C10"] * depth
    return NOTES[key]


class Noting:
    def __init__(self, factor):
        self.notes, self.settings = {}, {"factor": factor}

    def __call__(self, parameters, depth):
        self.notes[parameters["C10"]] = result = self.settings["factor"] * parameters["C10"] * depth
        return result


def noting_around(factor):
    notes, settings = {}, {"factor": factor}

    def force(parameters, depth):
        notes[parameters["C10"]] = result = settings["factor"] * parameters["C10"] * depth
        return result

    return force


@pytest.mark.parametrize("make", [lambda factor: noting, Noting, noting_around])
def test_a_dictionary_in_which_a_function_notes_its_results_is_no_part_of_it(make, monkeypatch):
    """A second call refused the runs of the first one; settings in a dictionary still count."""
    force = make(2.0)
    forward = as_forward(force)
    before = forward.identity
    forward.run({"C10": 1.5}, DEPTH)
    assert as_forward(force).identity == before
    monkeypatch.setitem(SETTINGS, "factor", 3.0)
    assert as_forward(make(3.0)).identity != before


@pytest.mark.parametrize(
    ("place", "content", "words"),
    [
        ("no.py:force", None, "there is no file"),
        ("cube.py:force", "x = 1", "has no function named 'force'"),
        ("cube.py:force", "x = ", "is not Python, line 1"),
        ("cube.py:force", "raise ValueError('no licence')", "fails, line 1: ValueError: no licence"),
        ("nothing.here:force", None, "cannot be imported"),
        ("math:nothing", None, "no function named 'nothing'"),
        ("force", None, "write path.py:function"),
    ],
)
def test_what_is_no_function_is_told_before_any_run(tmp_path, monkeypatch, place, content, words):
    monkeypatch.chdir(tmp_path)
    if content:
        (tmp_path / "cube.py").write_text(content + "\n")
    name = place if ".py" not in place else f"{tmp_path / place}"
    with pytest.raises(InputError, match=words):
        FileForward(name).check(["C10"])


@pytest.mark.parametrize(
    ("model", "names"), [(lambda depth, E: E * depth, "depth, E"), (lambda depth, E, m: E * depth**m, "depth, E, m")]
)
def test_a_function_of_single_parameters_is_told_before_any_run(model, names):
    priors = {"E": tq.Uniform(0.1, 1), "m": tq.Uniform(1, 2)}
    with pytest.raises(InputError, match=rf"takes {names}, each by itself. Write .* of a dictionary of parameters"):
        tq.calibrate(np.linspace(0.1, 1, 5), np.linspace(0.1, 1, 5), model, priors)


def test_a_function_of_a_module_is_found():
    assert FileForward("builtins:len").run({"C10": 1.0}, DEPTH) == 1


def test_a_run_that_fails_or_stops_early_is_a_result_and_a_wrong_shape_is_an_error():
    def broken(parameters):
        raise ZeroDivisionError("division by zero\nat length")

    task = ForwardRun(CallableForward(broken), (("C10", 1.0),), tuple(DEPTH), 1)
    assert carry_out(task)["error"] == "ZeroDivisionError: division by zero"
    some = ForwardRun(CallableForward(lambda p: np.where(DEPTH > 0.2, np.nan, 1)), (("C10", 1.0),), tuple(DEPTH), 1)
    assert "of 15 outputs are not finite, the first at the control " in carry_out(some)["error"]
    short = ForwardRun(CallableForward(lambda p: DEPTH[:-2]), (("C10", 1.0),), tuple(DEPTH), 1)
    assert carry_out(short)["error"].startswith("outputs of shape (13,); there are 15 measurements")
    with pytest.raises(InputError, match="15 measurements"):
        carry_out(ForwardRun(CallableForward(lambda p: 1.0), (("C10", 1.0),), tuple(DEPTH), 1))


def test_what_cannot_be_read_ends_all_runs_at_the_first_and_is_a_failed_run_later():
    def cut_short(parameters):
        raise UnreadableError("the results are cut short")

    first, later = (ForwardRun(CallableForward(cut_short), (("C10", 1.0),), tuple(DEPTH), number) for number in (1, 2))
    with pytest.raises(UnreadableError, match="the results are cut short"):
        carry_out(first)
    assert carry_out(later)["error"] == "UnreadableError: the results are cut short"


def runs_with(points, failed):
    results = [
        {"parameters": dict(zip("ab", point, strict=True)), "error": "it broke" if bad else "", "seconds": 1.0,
         "outputs": [1.0]}
        for point, bad in zip(points, failed, strict=True)
    ]  # fmt: skip
    return gathered(["a", "b"], results, 1)


def test_a_single_failure_is_told_by_its_values():
    points = np.array([[0.2, 3.0], [0.0018, 4.0], [0.5, 2.5]])
    text = runs_with(points, np.array([False, True, False])).failure_summary
    assert text == ("1 of 3 runs of the forward model failed, the one with a = 0.0018, b = 4. The reason: it broke.")


def test_the_region_of_failure_is_told():
    points = np.random.default_rng(0).random((30, 2))
    beyond = points[:, 1] > 0.7
    text = runs_with(points, beyond).failure_summary
    assert f"{beyond.sum()} of 30 runs of the forward model failed" in text
    assert f"all those with b from {points[beyond, 1].min():.4g} and none below {points[~beyond, 1].max():.4g}" in text
    assert "it broke" in text
    below = points[:, 0] < 0.3
    assert "all those with a up to" in runs_with(points, below).failure_summary
    corner = (points > 0.5).all(axis=1)
    (low, other_low), (high, other_high) = points[corner].min(axis=0), points[corner].max(axis=0)
    ranges = f"with a from {low:.4g} to {high:.4g} and b from {other_low:.4g} to {other_high:.4g}"
    assert f"{ranges}; no runs with values in these ranges succeeded" in runs_with(points, corner).failure_summary
    scattered = np.arange(30) % 2 == 0
    assert " runs with values in these ranges succeeded" in runs_with(points, scattered).failure_summary
    assert runs_with(points, np.zeros(30, bool)).failure_summary == ""


def test_runs_are_kept_and_not_made_again_but_failed_ones_are(tmp_path):
    calls = []

    class Model(CallableForward):
        def __init__(self):
            super().__init__(self.once)

        def once(self, parameters):
            calls.append(parameters["C10"])
            if parameters["C10"] == 2.0 and calls.count(2.0) == 1:
                raise OSError("the licence server is away")
            return neo_hooke(parameters)

    model = Model()
    with runs_of(model, PROBLEM, tmp_path / "runs", 1, silent) as run:
        first = run(POINTS)
    assert first.errors == ("", "OSError: the licence server is away", "")
    assert np.isnan(first.outputs[1]).all()
    told = []
    with runs_of(model, PROBLEM, tmp_path / "runs", 1, lambda label, is_new: told.append((label, is_new))) as run:
        second = run(np.vstack([POINTS, [[4.0]]]))
    assert calls == [1.0, 2.0, 3.0, 2.0, 4.0]
    assert sorted(told) == [("run 1", False), ("run 2", True), ("run 3", False), ("run 4", True)]
    np.testing.assert_allclose(second.outputs[1], neo_hooke({"C10": 2.0}))


def test_runs_of_another_model_or_of_other_controls_are_not_taken(tmp_path):
    def other(parameters):
        return 2 * neo_hooke(parameters)

    folder = tmp_path / "runs"
    with runs_of(as_forward(neo_hooke), PROBLEM, folder, 1, silent) as run:
        run(POINTS)
    with pytest.raises(InputError, match="its model differ"), runs_of(as_forward(other), PROBLEM, folder, 1, silent):
        pass
    elsewhere = pose(2 * DEPTH, DEPTH, PRIORS)
    with pytest.raises(InputError, match="control differ"):
        runs_of(as_forward(neo_hooke), elsewhere, folder, 1, silent).__enter__()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("all of it")
    with pytest.raises(InputError, match="not a folder of forward runs"):
        runs_of(as_forward(neo_hooke), PROBLEM, tmp_path / "mine", 1, silent).__enter__()


def test_a_folder_that_a_killed_process_had_just_made_is_taken(tmp_path):
    (tmp_path / "about.json.new").write_text('{"mod')
    with runs_of(as_forward(neo_hooke), PROBLEM, tmp_path, 1, silent) as run:
        assert not run(POINTS).failed.any()
    assert not (tmp_path / "about.json.new").exists()


def test_a_folder_without_any_run_does_not_stay(tmp_path):
    with pytest.raises(InputError, match="15 measurements"):
        tq.calibrate(DEPTH, DEPTH, lambda parameters: [1.0], PRIORS, folder=tmp_path / "runs")
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_processes_give_the_same_runs(tmp_path):
    file = tmp_path / "cube.py"
    file.write_text("def force(parameters, depth):\n    return parameters['C10'] * depth\n")
    with runs_of(FileForward(f"{file}:force"), PROBLEM, tmp_path / "runs", 2, silent) as run:
        found = run(POINTS)
    np.testing.assert_allclose(found.outputs, POINTS * DEPTH)
    lines = (tmp_path / "runs" / "batch-0" / "tasks.jsonl").read_text().splitlines()
    assert [json.loads(line)["parameters"]["C10"] for line in lines] == [1.0, 2.0, 3.0]


@pytest.mark.slow
def test_failed_runs_are_told_in_the_result():
    def fragile(parameters):
        if parameters["C10"] > 3.5:
            raise RuntimeError("the solver has not converged")
        return neo_hooke(parameters)

    measured = neo_hooke({"C10": 1.2}) + 0.05 * np.random.default_rng(0).standard_normal(len(DEPTH))
    found = tq.calibrate(DEPTH, measured, fragile, PRIORS, noise_sd=0.05, runs=16)
    assert found.runs.failed.sum() == (found.runs.points[:, 0] > 3.5).sum() > 0
    text = " ".join(found.warnings)
    assert "all those with C10 from" in text
    assert "the solver has not converged. The posterior is not near them." in text
    near = neo_hooke({"C10": 3.49}) + 0.05 * np.random.default_rng(0).standard_normal(len(DEPTH))
    found = tq.calibrate(DEPTH, near, fragile, PRIORS, noise_sd=0.5, runs=16)
    assert "the emulator is unreliable" in " ".join(found.warnings)


def locks(parameters, control):
    raise ConvergenceError("the solver gave up")


def test_of_several_models_the_one_that_fails_is_named_and_each_gets_its_controls():
    controls = {"force": np.array([1.0, 2.0]), "pull": np.array([3.0]), "neck": np.array([4.0, 5.0])}
    double = {"pull": lambda of: of["pull"] * 2, "neck": lambda of: of["neck"] * 3}
    models = as_forward(
        {
            "force": lambda parameters, control: parameters["a"] * control,
            ("pull", "neck"): lambda parameters, control: {name: of(control) for name, of in double.items()},
        }
    )
    outputs = models.run({"a": 10.0}, controls)
    assert {name: list(values) for name, values in outputs.items()} == {
        "force": [10.0, 20.0],
        "pull": [6.0],
        "neck": [12.0, 15.0],
    }
    failing = SeveralModels(((("force",), as_forward(locks)),))
    with pytest.raises(ConvergenceError, match=r"test_runs\.locks: the solver gave up"):
        failing.run({"a": 1.0}, controls)


def test_a_model_that_asks_for_a_parameter_without_a_prior_is_told_which_there_are():
    for name, words in (
        ("alpha", r"'alpha' \(there are priors of C10\)"),
        (3, r"3 \(there are priors of C10\)"),
        ("c", r"'c' \(there are priors of C10; c is of the discrepancy or the noise: give the model's another name\)"),
    ):

        def force(parameters, name=name):
            return parameters[name] * DEPTH

        priors = PRIORS | ({"c": tq.Uniform(0.1, 1)} if name == "c" else {})
        with pytest.raises(InputError, match=f"KeyError: {words}"):
            tq.calibrate(DEPTH, neo_hooke({"C10": 1.0}), force, priors, runs=16)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_after_first_runs_that_all_fail_no_more_are_made(tmp_path, workers):
    file = tmp_path / "broken.py"
    file.write_text("def force(parameters):\n    raise RuntimeError('no licence')\n")
    told = []
    with pytest.raises(InputError, match=r"the first 4 runs of the forward model all failed.*no licence"):
        tq.calibrate(
            DEPTH, neo_hooke({"C10": 1.0}), FileForward(f"{file}:force"), PRIORS, runs=16, workers=workers,
            folder=tmp_path / "runs", step=lambda label, is_new: told.append(label),
        )  # fmt: skip
    assert sorted(told) == [f"run {number}" for number in (1, 2, 3, 4)]
    (tmp_path / "mended.py").write_text("def force(parameters, depth):\n    return parameters['C10'] * depth\n")
    with runs_of(FileForward(f"{tmp_path / 'mended.py'}:force"), PROBLEM, tmp_path / "runs", 1, silent) as run:
        assert not run(POINTS).failed.any()  # a folder of failed runs alone is free for another model


def test_outputs_of_the_opposite_sign_are_refused_after_the_first_runs(tmp_path):
    count = 0

    def upside_down(parameters):
        nonlocal count
        count += 1
        return {"pull": neo_hooke(parameters), "force": -neo_hooke(parameters)}

    measured = dict.fromkeys(("pull", "force"), neo_hooke({"C10": 1.0}))
    with pytest.raises(InputError, match=r"^force: the outputs .* opposite signs: -.*--factor"):
        tq.calibrate(dict.fromkeys(measured, DEPTH), measured, upside_down, PRIORS, runs=16, folder=tmp_path / "runs")
    assert count == 4
    assert not (tmp_path / "runs").exists()


def test_runs_that_were_kept_stay_where_measurements_have_the_opposite_sign(tmp_path):
    measured, folder = neo_hooke({"C10": 1.0}), tmp_path / "runs"

    def force(parameters):
        return neo_hooke(parameters)

    tq.calibrate(DEPTH, measured, force, PRIORS, noise_sd=0.01, runs=8, folder=folder)
    before = (folder / "batch-0" / "tasks.jsonl").read_bytes()
    with pytest.raises(InputError, match="opposite signs"):
        tq.calibrate(DEPTH, -measured, force, PRIORS, noise_sd=0.01, runs=8, folder=folder)
    assert (folder / "batch-0" / "tasks.jsonl").read_bytes() == before


@pytest.mark.slow
def test_a_kept_run_is_told_of_once(tmp_path):
    told = []
    for _ in range(2):
        tq.calibrate(
            DEPTH, neo_hooke({"C10": 1.0}) + 0.01 * np.sin(40 * DEPTH), lambda p, depth: neo_hooke(p), PRIORS,
            noise_sd=0.01, runs=8, folder=tmp_path / "runs", step=lambda *result: told.append(result),
        )  # fmt: skip
    assert told == [(f"run {number}", is_new) for is_new in (True, False) for number in range(1, 9)]


@pytest.mark.parametrize(("problem", "kind"), [("", UnreadableError), ("it diverged", ConvergenceError)])
def test_where_a_solver_ended_early_it_may_have_ended_anywhere(problem, kind):
    """A control that goes back is a wrong sign or quantity, but for that of a run that failed."""
    model = tq.DeckForward("block.inp", "TISSUE", "neo-hookean", "RF2@TOP", (0.7, 1.2), along="U2@TOP")
    times, depth = np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.2, 0.2])
    curves = {quantity.name: (times, depth) for quantity in model.quantities}
    with pytest.raises(kind):
        model._at(np.array([0.1, 0.5]), "", curves, problem)


@pytest.mark.parametrize("factor", [1.0, -1.0])
def test_a_control_may_fall_in_model_and_data_alike(factor):
    model = tq.DeckForward(
        "block.inp", "TISSUE", "neo-hookean", "RF2@TOP", (0.7, 1.2), along="U2@TOP", along_factor=factor
    )
    times, depth = np.array([0.5, 1.0]), np.array([-1.5, -3.0]) * factor
    force, control = next(iter(model.measured.values())).name, np.array([-3.0, -1.5, -0.75])
    curves = {quantity.name: (times, depth) for quantity in model.quantities} | {force: (times, 10 * times)}
    np.testing.assert_allclose(model._at(control, next(iter(model.measured)), curves, ""), [10, 5, 2.5], rtol=1e-9)
    with pytest.raises(UnreadableError, match="give the sign, as --factor NAME=-1"):
        model._at(-control, next(iter(model.measured)), curves, "")


def test_a_control_that_is_held_is_told_as_what_it_is():
    model = tq.DeckForward("block.inp", "TISSUE", "neo-hookean", "RF2@TOP", (0.7, 1.2), along="U2@TOP")
    times, depth = np.array([0.5, 1.0, 2.0]), np.array([0.1, 0.2, 0.2])
    curves = {quantity.name: (times, depth) for quantity in model.quantities}
    with pytest.raises(UnreadableError, match=r"stands still or goes back at 0\.2, .*: leave holding and unloading"):
        model._at(np.array([0.1, 0.2]), "", curves, "")
