"""`tissuq schema`: what a settings file may hold."""

import json

import jsonschema
import pytest

from tissuq.cli.catalogue import schema_of
from tissuq.cli.command import CONFIGURED


def test_the_schema_names_types_defaults_units_and_options(cli):
    said = cli("schema", "structure")
    assert (said.status, said.err) == (0, "")
    schema = json.loads(said.out)
    draws = schema["properties"]["draws"]
    assert (draws["type"], draws["default"], draws["minimum"], draws["option"]) == ("integer", 64, 2, "--draws")
    assert schema["properties"]["force_noise"]["unit"] == "N"
    assert schema["properties"]["sizes"]["option"] == "--size"
    assert schema["required"] == ["run"]


@pytest.mark.parametrize("name", sorted(CONFIGURED))
def test_every_schema_is_one(name):
    jsonschema.Draft202012Validator.check_schema(schema_of(name))


def test_a_recipe_keeps_to_the_schema_and_an_unknown_setting_does_not(done, here, specimen):
    import tomllib

    done("fit", specimen, "--noise-sd", 1, "--discrepancy", "none", "--no-figures")
    recipe = tomllib.loads((here / "runs" / "specimen" / "run.toml").read_text())
    jsonschema.validate(recipe, schema_of("fit"))
    with pytest.raises(jsonschema.ValidationError, match="materail"):
        jsonschema.validate(recipe | {"materail": "yeoh"}, schema_of("fit"))


def test_a_file_may_hold_more_than_the_command_line_says():
    properties = schema_of("paper")["properties"]
    assert {"truth", "stretch_low"} <= set(properties)
    assert properties["points"]["option"] == "--measurements"
    assert properties["truth"]["option"] == "--true-value"
    assert "option" not in properties["stretch_low"]
    assert schema_of("coverage")["required"] == ["designs"]


def test_a_command_without_settings_has_no_schema(refused):
    refused(["'modes'"], "schema", "modes")
