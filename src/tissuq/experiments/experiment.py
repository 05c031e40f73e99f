"""What was measured: curves of engineering stress, of one test or of several, each along a path of its loading mode."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.arrays import FloatArray
from tissuq.drawing.panels import panels
from tissuq.errors import InputError
from tissuq.experiments.checked_arrays import agree, checked, checked_points, in_mpa
from tissuq.experiments.curve import Curve, draw_curves, small_svg
from tissuq.experiments.modes import LoadingMode, States, loading_mode
from tissuq.experiments.modes.path import UNMEASURED
from tissuq.experiments.units import StressUnit
from tissuq.experiments.units import stress_unit as stress_unit_of
from tissuq.parameters.checks import check_count
from tissuq.result_warning import ResultWarning, merged


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Experiment:
    """Measurements of one test: what it set, such as stretches, and the stresses. `Experiment.of` joins several tests.

    Parameters
    ----------
    mode : str or LoadingMode
        How the specimen was loaded.
    stretch : (n,) or (n, c) array, dimensionless
        What the mode controls: deformed over undeformed length, positive, or an amount of shear of either sign; a
        column for each control where there are several. Any order, repetitions allowed.
    stress : (n,) or (n, k) array, in ``stress_unit``
        Engineering (nominal) stress, tension positive and compression negative; a column for each stress of the mode
        where there are several. The attribute of this name is in MPa. Quantities of pint are taken in their unit.
    name : str
        A short name for tables and figures.
    source : str
        Where the values come from (a file and its columns, or a citation).
    stress_unit : str, optional
        Unit of the numbers in ``stress``, and the one in which people want to read them; without it that of pint's
        quantities, or MPa. `labelled` changes only the one to read.
    specimen : str
        Which specimen it was, where several tests are fitted together: those of one specimen share its errors of area
        and length. Without a name every test counts as one of a specimen of its own.
    standard_error : array like ``stress``, in the same unit, optional
        Standard errors of stresses that are means of several specimens. `tissuq.fit` takes them as the size of an error
        that is smooth along the curve (`Tolerances`), as neighbouring points of a mean curve err alike.
    least_errors : mapping of str to float, optional
        Standard deviations that errors of the test have at least, as the measurements themselves show, by their names
        in `tissuq.Tolerances`: ``{"slack": 0.01}`` where load begins at a stretch known to 0.01. Unless tolerances are
        stated as numbers, those of a fit are as large. The attribute is of several tests the largest ones.
    direction, condition : str
        In which direction of the tissue the specimen was loaded, and its state or treatment, in words.

    Attributes
    ----------
    curves : tuple of Curve
        Every measured stress, test by test.

    Raises
    ------
    InputError
        When the arrays differ in length, do not have the columns of the mode, are empty, or hold values that are not
        finite or not stretches, or a unit is none of stress.

    Examples
    --------
    >>> import tissuq as tq
    >>> data = tq.Experiment(mode="uniaxial", stretch=[0.9, 1.0, 1.2], stress=[-0.3, 0.0, 0.5])
    >>> len(data)
    3
    >>> tq.Experiment("uniaxial", stretch=[1.0, 1.2], stress=[0.0, 2.5], stress_unit="kPa").stress.tolist()
    [0.0, 0.0025]
    >>> both = tq.Experiment("biaxial", stretch=[[1.1, 1.0], [1.2, 1.1]], stress=[[0.3, 0.2], [0.5, 0.4]])
    >>> len(both), both.mode.stresses
    (2, ('engineering stress of axis 1', 'engineering stress of axis 2'))
    >>> tests = tq.Experiment.of([data, both])
    >>> len(tests.tests), len(tests.curves), tests.name
    (2, 3, 'experiment + experiment')
    """

    curves: tuple[Curve, ...]

    def __init__(
        self,
        mode: str | LoadingMode,
        stretch: ArrayLike,
        stress: ArrayLike,
        name: str = "experiment",
        source: str = "",
        stress_unit: str | None = None,
        specimen: str = "",
        standard_error: ArrayLike | None = None,
        least_errors: Mapping[str, float] | None = None,
        direction: str = "",
        condition: str = "",
    ) -> None:
        mode = loading_mode(mode)
        values, unit = in_mpa(stress, stress_unit)
        points, stresses = checked_points(mode, stretch), checked("stress", values, mode.stresses)
        if len(points) != len(stresses):
            raise InputError(
                f"experiment '{name}': {len(points)} stretches but {len(stresses)} stresses; "
                "give one stress for every stretch."
            )
        errors = np.zeros_like(stresses)
        if standard_error is not None:
            errors = checked("standard error", in_mpa(standard_error, stress_unit)[0], mode.stresses)
            if errors.shape != stresses.shape or (errors < 0).any():
                raise InputError(f"experiment '{name}': give one standard error for every stress, none negative.")
        columns = zip(stresses.reshape(len(stresses), -1).T, errors.reshape(len(stresses), -1).T, strict=True)
        labels, errors_at_least = (name, source, unit, specimen), dict(least_errors or {})
        curves = tuple(
            Curve(mode, channel, points, *column, *labels, errors_at_least, direction, condition)
            for channel, column in enumerate(columns)
        )
        object.__setattr__(self, "curves", curves)

    @classmethod
    def of(cls, tests: Experiment | Sequence[Experiment]) -> Experiment:
        """Return several tests as one experiment; a single one as it is.

        Raises
        ------
        InputError
            When there is none, or the same measurements are there twice.
        """
        if isinstance(tests, Experiment):
            return tests
        for number, test in enumerate(tests, 1):
            if not isinstance(test, Experiment):
                raise InputError(f"experiment number {number} is no tissuq.Experiment, but {test!r:.80}.")
        single = [test for experiment in tests for test in experiment.tests]
        if not single:
            raise InputError("there is no experiment to fit.")
        for (number, test), (later, same) in combinations(enumerate(single, 1), 2):
            if test.has_measurements_of(same):
                raise InputError(
                    f"experiments number {number} ('{test.name}') and {later} ('{same.name}') hold the same "
                    "measurements, which would count twice: leave one of them out."
                )
        return single[0] if len(single) == 1 else cls._of_curves(curve for test in single for curve in test.curves)

    @classmethod
    def _of_curves(cls, curves: Iterable[Curve]) -> Experiment:
        experiment = cls.__new__(cls)
        object.__setattr__(experiment, "curves", tuple(curves))
        return experiment

    def __len__(self) -> int:
        return sum(len(test.curves[0]) for test in self.tests)

    def __repr__(self) -> str:
        modes = ", ".join(mode.name for mode in self.modes)
        return f"<Experiment '{self.name}': {modes}, {self.size} measured stresses in {self.stress_unit}>"

    def plot(self, ax: Any = None, *, unit: str | None = None) -> Any:
        """Draw every measured stress on a panel of its own, before any fit.

        Parameters
        ----------
        ax : Axes, or array of Axes, optional
            As many as there are `curves`; unless given, a new figure is made in `matplotlib.pyplot`.
        unit : str, optional
            Of the stress, such as ``"kPa"``; ``stress_unit`` unless given.

        Returns
        -------
        Axes, or (n,) array of Axes

        Examples
        --------
        >>> import tissuq as tq
        >>> axis = tq.datasets.load("brain-cortex-uniaxial").plot()
        >>> axis.get_xlabel(), axis.get_ylabel()
        ('stretch', 'engineering stress [kPa]')
        >>> import matplotlib.pyplot as plt
        >>> plt.close(axis.figure)
        """
        with panels(ax, len(self.curves)) as drawn:
            draw_curves(drawn, self.curves, unit or self.stress_unit)
        return drawn.result

    def _repr_html_(self) -> str:
        """Return a table of the curves above a small figure of them, which notebooks show."""
        import pandas as pd

        rows = []
        for curve in self.curves:
            ends = [curve.abscissa.min(), curve.abscissa.max()]
            stress = curve.stress / stress_unit_of(self.stress_unit).to_mpa
            span = {"from": ends[0], "to": ends[1], f"stress from [{self.stress_unit}]": stress.min()}
            labels = {"test": curve.name, "specimen": curve.specimen, "mode": curve.mode.name, "rows": len(curve)}
            rows.append(labels | span | {f"stress to [{self.stress_unit}]": stress.max()})
        table = pd.DataFrame(rows).to_html(index=False, float_format="{:.5g}".format)
        return f"{table}{small_svg(self.curves, self.stress_unit)}"

    @property
    def size(self) -> int:
        """The number of measured stresses."""
        return sum(map(len, self.curves))

    @cached_property
    def tests(self) -> tuple[Experiment, ...]:
        """The tests that it is made of."""
        if len(self.curves) == len(self.curves[0].mode.stresses):
            return (self,)
        tests, start = [], 0
        while start < len(self.curves):
            stop = start + len(self.curves[start].mode.stresses)
            tests.append(self._of_curves(self.curves[start:stop]))
            start = stop
        return tuple(tests)

    @property
    def name(self) -> str:
        """The name of the test, or those of all."""
        return " + ".join(test.curves[0].name for test in self.tests)

    @property
    def source(self) -> str:
        """Where the values come from."""
        return "; ".join(test.curves[0].source for test in self.tests if test.curves[0].source)

    @property
    def stress_unit(self) -> str:
        """The unit in which people give the stresses: that of the first test."""
        return self.curves[0].stress_unit

    @property
    def shown_unit(self) -> StressUnit:
        """The unit in which pages show stresses: that, or kPa or Pa where they are small in it."""
        return stress_unit_of(self.stress_unit).readable(float(np.abs(self.measured).max()))

    @property
    def specimen(self) -> str:
        """Which specimen it was; of several tests see that of each."""
        return self.curves[0].specimen if len(self.tests) == 1 else ""

    @property
    def direction(self) -> str:
        """In which direction of the tissue it was loaded; of several tests see that of each."""
        return self.curves[0].direction if len(self.tests) == 1 else ""

    @property
    def condition(self) -> str:
        """The state or the treatment of the specimen; of several tests see that of each."""
        return self.curves[0].condition if len(self.tests) == 1 else ""

    @property
    def least_errors(self) -> dict[str, float]:
        """Standard deviations that errors of the tests have at least, by their names: the largest of all tests."""
        pairs = [pair for curve in self.curves for pair in curve.least_errors.items()]
        return {name: max(size for same, size in pairs if same == name) for name, _ in pairs}

    @cached_property
    def shows_direction(self) -> bool:
        """Whether every test measured the stresses of two axes of a sheet, so that a preferred direction would show."""
        plane = self.states.moved(0.0).plane
        is_known = all(component is not None and np.isfinite(component).all() for component in plane)
        return is_known and not np.any(plane[2]) and all(len(test.curves) > 1 for test in self.tests)

    @property
    def is_along_both_axes(self) -> bool:
        """Whether there are tests in one loading mode along axis 1 and along axis 2 of the tissue."""
        return any(mode.along_axis_1 != mode and mode.along_axis_1 in self.modes for mode in self.modes)

    @property
    def mode(self) -> LoadingMode:
        """How the specimen was loaded in the test."""
        return self._only_test[0].mode

    @property
    def stretch(self) -> FloatArray:
        """What the test set: (n,), or (n, c) for c controls."""
        return self._only_test[0].points

    @cached_property
    def stress(self) -> FloatArray:
        """What the test measured, MPa: (n,), or (n, k) for k stresses."""
        columns = [curve.stress for curve in self._only_test]
        return columns[0] if len(columns) == 1 else np.column_stack(columns)

    @cached_property
    def standard_error(self) -> FloatArray:
        """The standard error of every measured stress as the mean of several specimens (size,), curve by curve, MPa.

        Zero where it is of one.
        """
        return np.concatenate([curve.standard_error for curve in self.curves])

    @property
    def _only_test(self) -> tuple[Curve, ...]:
        """The curves of the only test."""
        if len(self.tests) > 1:
            raise InputError(
                f"'{self.name}' are {len(self.tests)} tests, each with a mode, stretches and stresses of its own: take "
                "one of its tests."
            )
        return self.curves

    @property
    def modes(self) -> tuple[LoadingMode, ...]:
        """The different modes of its tests."""
        return tuple(dict.fromkeys(curve.mode for curve in self.curves))

    @cached_property
    def measured(self) -> FloatArray:
        """Every measured stress (size,), curve by curve, MPa."""
        return (
            np.concatenate([curve.stress for curve in self.curves]) if len(self.curves) > 1 else self.curves[0].stress
        )

    @cached_property
    def states(self) -> States:
        """The states of deformation at which the stresses `measured` were."""
        return States.joined([curve.path.at(curve.points, number) for number, curve in enumerate(self.curves)])

    def states_at(self, points: FloatArray, mode: LoadingMode | None = None, channel: int = 0) -> States:
        """Return the states at points of a mode, as measured by the first test of that mode where there is one.

        ``mode`` is that of the only test unless said; ``channel`` is the number of the stress, where it has several.
        """
        mode = mode or self.mode
        curves = (number for number, curve in enumerate(self.curves) if (curve.mode, curve.channel) == (mode, channel))
        return mode.paths[channel].at(points, next(curves, UNMEASURED))

    def states_of(self, curve: Curve, points: FloatArray) -> States:
        """Return the states at points of one of the curves."""
        return curve.path.at(points, self.curves.index(curve))

    @property
    def warnings(self) -> tuple[ResultWarning, ...]:
        """What is implausible in files and tests that were read, each once with the names of the tests of several."""
        of_tests = zip(labels_of_tests(self.tests), (test.curves[0].warnings for test in self.tests), strict=True)
        return tuple(merged(dict(of_tests), everyone="all tests"))

    def labelled(self, **labels: str | int | tuple[ResultWarning, ...]) -> Experiment:
        """Return the same measurements with other labels of `Curve`, such as name, source, unit to read or specimen."""
        return self._of_curves(replace(curve, **labels) for curve in self.curves)  # type: ignore[arg-type]  # by name

    def where(self, selected: NDArray[Any]) -> Experiment:
        """Return only some measurements of a test: a mask (n,), or numbers of its rows."""
        columns = "points", "stress", "standard_error"
        curves = (
            replace(curve, **{name: getattr(curve, name)[selected] for name in columns}) for curve in self._only_test
        )
        return self._of_curves(curves)

    def averaged(self, size: int) -> Experiment:
        """Return about so many stresses at most: means of consecutive measurements where there are more.

        Parameters
        ----------
        size : int
            Of all curves together, which share it equally; none is left with fewer than 200 rows by that.

        Examples
        --------
        >>> import numpy as np, tissuq as tq
        >>> stretch = np.linspace(1, 1.5, 90_000)
        >>> data = tq.Experiment("uniaxial", stretch, stretch - stretch**-2)
        >>> data.averaged(2000), data.averaged(2000).rows_name
        (<Experiment 'experiment': uniaxial, 2000 measured stresses in MPa>, 'means of 45 measurements')
        """
        check_count(size, "size must be a number of rows, one or more")
        if self.size <= size:
            return self
        return self._of_curves(curve.of_means(size // len(self.curves)) for curve in self.curves)

    def in_means_as(self, experiment: Experiment) -> Experiment:
        """Return means of as many measurements as the rows of another experiment are, where these are means."""
        most = experiment.averaged_at_most
        return self if most == 1 else self._of_curves(curve.in_means_of(most) for curve in self.curves)

    @property
    def averaged_at_most(self) -> int:
        """How many measurements its rows are means of at the most; 1 where they are single ones."""
        return max(curve.averaged for curve in self.curves)

    @property
    def rows_name(self) -> str:
        """What its rows are, in words: measurements, or means of some."""
        most = self.averaged_at_most
        several = "up to " * (len({curve.averaged for curve in self.curves}) > 1)
        return f"means of {several}{most} measurements" if most > 1 else "measurements"

    def has_measurements_of(self, experiment: Experiment) -> bool:
        """Return whether another experiment has the same curves, be it read in another unit."""
        return len(self.curves) == len(experiment.curves) and all(
            curve.mode == same.mode and agree(curve.points, same.points) and agree(curve.stress, same.stress)
            for curve, same in zip(self.curves, experiment.curves, strict=True)
        )

    def joined(self, experiment: Experiment) -> Experiment:
        """Return this experiment with the measurements of another one in the same loading mode added.

        Raises
        ------
        InputError
            When the loading modes differ, or there are several tests, or rows are means of more measurements in one.
        """
        if len(self.tests) > 1:
            raise InputError(
                f"experiment '{experiment.name}' cannot be added to a fit of several tests: fit all together again."
            )
        if experiment.mode != self.mode:
            raise InputError(
                f"experiment '{experiment.name}' is {experiment.mode.name} and experiment '{self.name}' "
                f"{self.mode.name}: only measurements in the same loading mode can be added."
            )
        averaged = self.curves[0].averaged
        if experiment.curves[0].averaged != averaged:
            raise InputError(
                f"experiment '{experiment.name}' ({experiment.rows_name}) cannot be added to '{self.name}' "
                f"({self.rows_name}): means are less uncertain than single measurements. Fit all together again."
            )
        columns = [
            (test.stretch, test.stress, test.standard_error.reshape(test.stress.T.shape).T)
            for test in (self, experiment)
        ]
        stretch, stress, error = map(np.concatenate, zip(*columns, strict=True))
        labels = {name: getattr(self, name) for name in ("name", "source", "specimen", "direction", "condition")}
        joined = Experiment(self.mode, stretch, stress, standard_error=error, least_errors=self.least_errors)
        warnings = (*self.warnings, *experiment.warnings)
        return joined.labelled(stress_unit=self.stress_unit, averaged=averaged, warnings=warnings, **labels)


def labels_of_tests(tests: Sequence[Experiment]) -> list[str]:
    """Return the names of tests, those of the same name numbered by their places among all."""
    names = [test.name for test in tests]
    return [f"{name} ({number})" if names.count(name) > 1 else name for number, name in enumerate(names, 1)]
