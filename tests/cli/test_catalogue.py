from pathlib import Path

import pytest

from tissuq import datasets, discrepancies, loading_modes, materials
from tissuq.mechanics.named import FORMS


@pytest.mark.parametrize(("command", "kinds"), [("materials", materials), ("discrepancies", discrepancies)])
def test_every_variant_is_listed_with_its_formula_and_parameters(cli, command, kinds):
    said = cli(command)
    assert (said.status, said.err) == (0, "")
    for kind in kinds().values():
        assert f"{kind.name}\n    {kind.formula}" in said.out
        assert all(parameter.description in said.out for parameter in kind.parameters)


def test_names_that_are_not_listed_are_told(cli):
    said = cli("materials")
    assert all(form in said.out for form in FORMS)


@pytest.mark.parametrize("name", ["materials", "modes"])
def test_the_page_of_what_there_is_is_up_to_date(done, name):
    said = done(name, "--markdown")
    page = Path(__file__).parents[2] / "docs" / f"{name}.md"
    assert said.out == page.read_text(encoding="utf-8"), f"run: tissuq {name} --markdown > docs/{name}.md"


def test_no_line_of_the_list_of_materials_is_too_long_to_read(cli):
    assert max(map(len, cli("materials").out.splitlines())) <= 130


def test_the_loading_modes_are_listed_with_what_they_set_and_measure(done):
    said = done("modes")
    for kind in loading_modes().values():
        assert f"{kind.name}\n    {kind.description}\n    sets {kind.controls[0].name}" in said.out
        assert all(stress in said.out for stress in kind.stresses)


def test_the_data_sets_are_listed_with_their_citations(done):
    said = done("datasets")
    assert "rubber-treloar-uniaxial\n    Treloar 1944" in said.out


def test_a_data_set_is_copied_into_a_new_folder(done, here):
    done("datasets", "--copy", "rubber-treloar-uniaxial", "--to", "data/new")
    copied = here / "data" / "new" / "rubber-treloar-uniaxial.csv"
    assert copied.read_bytes() == datasets.path("rubber-treloar-uniaxial").read_bytes()


def test_a_copied_data_set_is_overwritten_with_force_alone(refused, done, here):
    there = here / "rubber-treloar-uniaxial.csv"
    there.write_text("mine")
    refused(["--force"], "datasets", "--copy", "rubber-treloar-uniaxial")
    assert there.read_text() == "mine"
    done("datasets", "--copy", "rubber-treloar-uniaxial", "--force")
    assert there.read_text() != "mine"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--copy", "rubber-treloar-uni"], ["'rubber-treloar-uni'", "Did you mean 'rubber-treloar-uniaxial'?"]),
        (["--copy", ""], ["no data set named ''"]),
        (["--to", "folder"], ["--to", "--copy NAME"]),
        (["--force"], ["--force", "--copy NAME"]),
        (["--copy", "rubber-treloar-uniaxial", "--to", "a-file"], ["a-file"]),
    ],
)
def test_a_copy_that_cannot_be_made_is_refused(refused, here, arguments, words):
    (here / "a-file").write_text("mine")
    refused(words, "datasets", *arguments)
    assert [path.name for path in here.iterdir()] == ["a-file"]
