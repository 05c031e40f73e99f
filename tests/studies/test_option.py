"""Settings that declare their options."""

from pathlib import Path
from typing import Literal

import pytest
from pydantic import ValidationError

from tissuq.errors import InputError
from tissuq.studies.option import Settings, argument, option, options_of
from tissuq.studies.option_texts import columns_by_role, pairs_of, priors, range_of, tolerances
from tissuq.studies.settings import load_settings


class Throw(Settings):
    """Settings of every kind."""

    target: str = argument(..., "Where to.", takes=Path)
    count: int = option(3, "How many.", ge=1)
    speed: float = option(2.50, "How fast [as fast as can be].")
    names: tuple[str, ...] = option((), "Whose; repeat for more.", name="name")
    numbers: tuple[int, ...] = option((), "Which.")
    is_far: bool = option(False, "Far.")
    kind: Literal["high", "low"] | None = option(None, "high or low.")
    way: str = option("sobol", "A way.", choices="tissuq.posterior.drawn_materials:Sampling")
    inner: int = 3


def test_only_what_is_declared_is_an_option_and_its_help_has_the_default():
    found = {name: declared.explained(info) for name, declared, info in options_of(Throw)}
    assert found == {
        "target": "Where to.",
        "count": "How many [3].",
        "speed": "How fast [as fast as can be].",
        "names": "Whose; repeat for more.",
        "numbers": "Which.",
        "is_far": "Far.",
        "kind": "high or low.",
        "way": "A way [sobol].",
    }


def test_the_command_line_reads_what_the_type_of_the_setting_says():
    found = {name: declared.read_as(info) for name, declared, info in options_of(Throw)}
    plain = {"count": int, "speed": float, "is_far": bool, "kind": str, "way": str}
    assert found == {"target": Path, "names": list[str], "numbers": list[int], **plain}


def test_choices_are_those_of_the_type_that_is_named():
    assert Throw(target="x", way="latin").way == "latin"
    with pytest.raises(ValidationError, match="must be 'sobol', 'latin' or 'random', not 'halton'"):
        Throw(target="x", way="halton")


def test_a_message_names_the_option_as_it_was_typed():
    with pytest.raises(InputError, match=r"^count \(--how-many\): .*\(it is 0\)\.$"):
        load_settings(Throw, None, {"target": "x", "count": 0}, typed={"count": "--how-many"})
    with pytest.raises(InputError, match=r"^count: "):
        load_settings(Throw, None, {"target": "x", "count": 0}, typed={"count": "--count"})


@pytest.mark.parametrize(
    ("parse", "texts", "value"),
    [
        (pairs_of("--size", "a size", "NAME=VALUE", float), ["a = 1", "b=2"], {"a": 1.0, "b": 2.0}),
        (pairs_of("--only", "a row", "COLUMN=VALUE", divided_last=True), ["a=b=c"], {"a=b": "c"}),
        (columns_by_role, ["stress=P", "strain=2", "stress=Q=1"], {"stress": ["P", "Q=1"], "strain": 2}),
        (range_of("--stretch", "1:2"), "0.7:1.3", (0.7, 1.3)),
        (tolerances, ["stress=10%", "slack=0.01"], {"stress": 0.1, "slack": 0.01}),
        (tolerances, ["none"], {}),
        (priors, ["C10=uniform(0, 5)"], {"C10": {"distribution": "uniform", "low": 0.0, "high": 5.0}}),
        (
            priors,
            ["a=normal(1, sd = 2, high=3)"],
            {"a": {"distribution": "normal", "mean": 1.0, "sd": 2.0, "high": 3.0}},
        ),
    ],
)
def test_what_is_typed_is_understood(parse, texts, value):
    assert parse(texts) == value


@pytest.mark.parametrize(
    ("parse", "texts", "words"),
    [
        (pairs_of("--size", "a size", "NAME=VALUE"), ["a"], "'a' is not a size .--size.; write NAME=VALUE"),
        (pairs_of("--size", "a size", "NAME=VALUE"), ["a=1", "a=2"], "--size is given twice for 'a'"),
        (range_of("--stretch", "1:2"), "1:2:3", "--stretch needs LOW:HIGH, such as 1:2, not '1:2:3'"),
        (tolerances, ["stress=ten"], "'stress=ten' is not a tolerance"),
    ],
)
def test_what_cannot_be_understood_says_what_to_write(parse, texts, words):
    with pytest.raises(InputError, match=words):
        parse(texts)
