"""Other packages add variants of every kind through entry points, and those that cannot be used are named."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, EntryPoints
from types import ModuleType

import pytest

import tissuq as tq
from tissuq import registry
from tissuq.decks.result_file import ResultFile, Results
from tissuq.experiments.modes import loading_mode
from tissuq.experiments.modes.one_control import Uniaxial
from tissuq.experiments.reading import FileFormat
from tissuq.experiments.units import stress_unit
from tissuq.export.cards import CardFormat, card_format
from tissuq.finite_elements import Case, ClampedBar
from tissuq.model.discrepancy import Constant, discrepancy_named
from tissuq.model.measurement_errors import ZeroError
from tissuq.model.noise import noise_named
from tissuq.parameters.priors import prior_from
from tissuq.studies.fit_settings import SpecimenSettings

BASES = [
    tq.Material,
    tq.LoadingMode,
    tq.Discrepancy,
    tq.Noise,
    tq.MeasurementError,
    tq.Prior,
    FileFormat,
    CardFormat,
    ResultFile,
    Case,
]


@pytest.fixture
def package(monkeypatch):
    """Return a module of another package, whose classes are entry points of their base class and go with the test."""
    module = ModuleType("another_package")
    monkeypatch.setitem(sys.modules, module.__name__, module)

    def select(**wanted):
        points = [
            EntryPoint(name, f"another_package:{name}", base.entry_point_group)
            for name, kind in vars(module).items()
            for base in BASES
            if not name.startswith("_") and (kind is None or issubclass(kind, base))
        ]
        return EntryPoints(points).select(**wanted)

    monkeypatch.setattr(registry, "entry_points", select)
    yield module
    for kind in vars(module).values():
        if isinstance(kind, type) and "name" in vars(kind):
            del kind.name


def test_every_base_class_has_a_group_of_its_own():
    groups = [base.entry_point_group for base in BASES]
    assert len(set(groups)) == len(groups)
    assert all(group.startswith("tissuq.") for group in groups)


def test_classes_of_other_packages_are_found_by_the_name_of_their_entry_point(package):
    bases = {
        "offset": Constant,
        "loud": tq.UnknownNoise,
        "settling": ZeroError,
        "upright": Uniaxial,
        "box": tq.Uniform,
        "pulled": ClampedBar,
        "plain": CardFormat,
    }
    members = {"__module__": package.__name__, "description": "", "cards": lambda *arguments: None}
    kinds = {name: type(name.title(), (base,), {**members, "name": name}) for name, base in bases.items()}
    vars(package).update(kinds)
    assert type(discrepancy_named("offset")) is kinds["offset"]
    assert type(noise_named("loud")) is kinds["loud"]
    assert type(SpecimenSettings(file="a.csv", noise="loud").noise_in(stress_unit("kPa"))) is kinds["loud"]
    assert [type(error) for error, _ in tq.Tolerances(settling=0.1)] == [kinds["settling"]]
    assert type(loading_mode("upright")) is kinds["upright"]
    assert type(prior_from({"distribution": "box", "low": 0, "high": 1})) is kinds["box"]
    assert type(card_format("plain")) is kinds["plain"]
    assert registry.find(Case, "case", "pulled", tq.InputError) is kinds["pulled"]
    assert [registry.plugins(base) for base in (tq.LoadingMode, Case)] == [[kinds["upright"]], [kinds["pulled"]]]


def test_a_result_file_of_another_package_is_chosen_by_its_suffix(package, tmp_path):
    methods = {
        "suffixes": (".d3plot",),
        "requests": {},
        "nodes": property(lambda self: []),
        "field": lambda self, kind: None,
    }
    vars(package)["shells"] = type("Shells", (ResultFile,), {"__module__": package.__name__, **methods})
    (tmp_path / "job.d3plot").touch()
    assert type(Results(tmp_path, "job").file) is vars(package)["shells"]


def test_a_broken_entry_point_is_refused_with_its_name_and_package(package):
    package.broken = None
    with pytest.raises(tq.ModelError, match=r"'broken' of another package \(tissuq\.modes: another_package:broken\)"):
        loading_mode("broken")
    with pytest.raises(tq.ModelError, match=r"is not a subclass of .*Discrepancy"):
        discrepancy_named("broken")


def test_a_class_that_lacks_what_lists_show_is_refused_by_what_it_lacks(package):
    members = {
        "__module__": package.__name__,
        "name": "leaning",
        "principal_stretches": lambda self, point: (point, point**-0.25, point**-0.75),
    }
    package.leaning = type("Leaning", (tq.LoadingMode,), members)
    with pytest.raises(tq.ModelError, match=r"another_package:leaning.*the class has no description"):
        registry.plugins(tq.LoadingMode)
    package.leaning.description = "pulled at an angle"
    assert registry.plugins(tq.LoadingMode) == [package.leaning]


def test_an_unknown_name_is_still_refused_by_the_kind_that_was_meant(package):
    with pytest.raises(tq.InputError, match="there is no noise named"):
        noise_named("unkown")
    with pytest.raises(tq.ModelError, match="there is no discrepancy named 'constnt'"):
        discrepancy_named("constnt")


def test_a_class_under_the_name_of_another_is_refused_as_a_saved_run_would_name_that(package):
    package.moved = type("Moved", (Constant,), {"__module__": package.__name__})
    with pytest.raises(tq.ModelError, match=r"another_package:moved.*calls itself 'constant': give both one name"):
        discrepancy_named("moved")
