"""The structure holds: stages import only to their left, and the documented code runs."""

from __future__ import annotations

import ast
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import tissuq
from tissuq import Discrepancy, Material, Noise, StretchMaterial
from tissuq.registry import variants

ROOT = Path(tissuq.__file__).parent
STAGES = [
    "arrays", "errors", "registry", "result_warning", "parameters", "drawing", "experiments", "mechanics", "model",
    "inference", "prediction", "assessment", "next_test", "pictures", "posterior", "population", "export",
    "finite_elements", "decks", "emulation", "studies", "validation", "report", "app", "cli", "__main__",
]  # fmt: skip


def imports_of(file: Path) -> set[str]:
    modules = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("tissuq."):
            modules.add(node.module.split(".")[1])
        elif isinstance(node, ast.Import):
            modules |= {name.name.split(".")[1] for name in node.names if name.name.startswith("tissuq.")}
    return modules


@pytest.mark.parametrize("file", sorted(ROOT.rglob("*.py")), ids=lambda file: str(file.relative_to(ROOT)))
def test_a_stage_imports_only_stages_to_its_left(file):
    stage = file.relative_to(ROOT).parts[0].removesuffix(".py")
    if stage == "__init__":
        return
    assert stage in STAGES
    later = STAGES[STAGES.index(stage) + 1 :]
    assert not imports_of(file) & set(later)


def test_no_two_modules_import_each_other_even_for_types():
    files = {file: file.relative_to(ROOT.parent).with_suffix("") for file in ROOT.rglob("*.py")}
    module_of = {file: ".".join(path.parts).removesuffix(".__init__") for file, path in files.items()}
    imports = {module: set() for module in module_of.values()}
    for file, module in module_of.items():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                names = {f"{node.module}.{name.name}" for name in node.names}
                imports[module] |= names & imports.keys() or {node.module} & imports.keys()
    assert not [(one, other) for one in imports for other in imports[one] if one in imports[other]]


def test_a_name_that_begins_with_an_underscore_is_of_its_module_alone():
    for file in ROOT.rglob("*.py"):
        nodes = [
            node for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(node, ast.ImportFrom)
        ]
        names = [name.name for node in nodes if (node.module or "").startswith("tissuq") for name in node.names]
        assert not [name for name in names if name.startswith("_") and not name.endswith("__")], file


@pytest.mark.slow
def test_the_page_of_the_architecture_lists_the_files_as_they_are():
    table = runpy.run_path(str(ROOT.parents[1] / "docs" / "architecture_table.py"))
    text = table["PAGE"].read_text(encoding="utf-8")
    assert table["stages_of"](text) == STAGES[4:-1]
    assert table["page"](text, STAGES[4:-1]) == text, "run: make architecture"


def test_the_statistics_of_the_data_know_nothing_of_the_rest():
    assert imports_of(ROOT / "model" / "statistics.py") <= {"arrays"}


def test_inference_knows_no_particular_material_discrepancy_or_noise():
    kinds = (Material, StretchMaterial, Discrepancy, Noise)
    names = {variant.__name__ for kind in kinds for variant in variants(kind).values()}
    assert {"NeoHookean", "Ogden1", "GaussianProcess", "Constant", "RepeatNoise"} <= names
    for file in (ROOT / "inference").rglob("*.py"):
        assert not names & {node.id for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Name)}


@pytest.mark.slow
@pytest.mark.parametrize(
    "document",
    [
        *["CONTRIBUTING.md", "docs/prediction.md", "docs/reading.md"],
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in (
                "README.md",
                "docs/python.md",
                "docs/several-tests.md",
                "docs/expensive-models.md",
                "docs/plots.md",
                "docs/warnings.md",
            )
        ),
    ],
)
def test_the_python_in_the_documents_runs(document, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # for the files that it writes
    text = (ROOT.parents[1] / document).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, document, "exec"), {})


def test_every_public_name_is_there_and_documented():
    for name in tissuq.__all__:
        assert (getattr(tissuq, name).__doc__ or "").strip(), name
    assert {"Experiment", "fit", "datasets"} <= set(tissuq.__all__) <= set(dir(tissuq))


def test_importing_the_package_imports_none_of_it_before_it_is_used():
    code = (
        "import sys, tissuq\n"
        "before = [name for name in sys.modules if name.startswith('tissuq.') or name == 'numpy']\n"
        "from tissuq import InputError\n"
        "print(before, tissuq.errors.InputError is InputError, hasattr(tissuq, 'no_such_name'))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "[] True False"


@pytest.mark.slow
def test_variants_are_listed_before_anything_else_of_the_package_is_used():
    listings = ("tissuq.materials()", "tissuq.discrepancies()", "tissuq.loading_modes()")
    for listing in listings:
        code = f"import tissuq\nprint(sorted({listing}))"
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        names = sorted(name for name, kind in eval(listing).items() if kind.__module__.startswith("tissuq."))
        assert ast.literal_eval(said) == names
