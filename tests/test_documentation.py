"""The site: every command, option and public name has its place, code is run, nothing comes from outside."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tissuq

ROOT = Path(tissuq.__file__).parents[2]
DOCS = ROOT / "docs"


def hook(name):
    specification = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / "hooks" / f"{name}.py")
    module = sys.modules[specification.name] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


execution, formulas, generated, offline = (hook(name) for name in ("execution", "formulas", "generated", "offline"))


def help_of(*words):
    """What a person reads who asks a command for help."""
    command = [sys.executable, "-m", "tissuq", *words, "--help"]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


def listed_commands(*words):
    commands = help_of(*words).partition("\n  --help ")[2]  # the last option; commands follow under their headings
    return re.findall(r"^  ([a-z]\S*)", commands, flags=re.MULTILINE)


@pytest.mark.slow
def test_every_command_that_help_lists_has_a_page():
    pages = generated.command_pages()
    names = [name for name in listed_commands() if name != "study"] + [f"study {n}" for n in listed_commands("study")]
    assert {"fit", "init", "doctor", "study coverage"} <= set(names)
    assert {f"commands/{name.replace(' ', '-')}.md" for name in names} == set(pages) - {"commands/index.md"}
    assert all(f"`tissuq {name}`" in pages["commands/index.md"] for name in names)


@pytest.mark.parametrize("name", sorted(generated.commands()))
def test_every_option_that_help_names_is_on_the_page_of_its_command(name, cli_help):
    page = generated.command_pages()[f"commands/{name.replace(' ', '-')}.md"]
    options = set(re.findall(r"^  (--[a-z][\w-]*)", cli_help(name), flags=re.MULTILINE)) - {"--help"}
    assert options <= set(re.findall(r"<code>(--[\w-]+)</code>", page))
    assert all(f'<dt id="{option[2:]}">' in page for option in options)


@pytest.fixture
def cli_help(monkeypatch, capsys):
    """The help of a command, without a process of its own."""
    from tissuq.cli import main

    def said(name):
        monkeypatch.setattr(sys, "argv", ["tissuq", *name.split(), "--help"])
        with pytest.raises(SystemExit):
            main()
        return capsys.readouterr().out

    return said


def test_the_check_of_options_has_options_to_check(cli_help):
    assert len(re.findall(r"^  (--[a-z][\w-]*)", cli_help("fit"), flags=re.MULTILINE)) > 20


def test_every_public_name_stands_once_in_the_reference():
    pages = generated.reference_pages()
    text = "\n".join(pages.values())
    named = re.findall(r"^::: tissuq\.(\w+)$", text, flags=re.MULTILINE)
    assert sorted(named) == sorted(tissuq.__all__)
    assert all(f"[`{name}`][tissuq.{name}]" in pages["reference/index.md"] for name in tissuq.__all__)


def test_names_in_documents_and_examples_are_public():
    """Others are attributes only after something else has imported their module."""
    files = [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "src").rglob("*.py")]
    texts = {str(file): file.read_text(encoding="utf-8") for file in files}
    named = {(name, file) for file, text in texts.items() for name in re.findall(r"\btq\.(\w+)", text)}
    assert {("fit", str(ROOT / "README.md")), ("mechanics", str(DOCS / "finite-elements.md"))} <= named
    assert [place for place in sorted(named) if place[0] not in tissuq.__all__] == []


def test_the_guides_of_commands_are_pages_of_commands():
    known = {name.split()[0] for name in generated.commands()}
    assert set(generated.GUIDES) <= known
    made = set(generated.ROOT_FILES.values())
    assert all((DOCS / page).exists() or page in made for pages in generated.GUIDES.values() for page in pages)


@pytest.mark.parametrize("document", ["README.md", "CONTRIBUTING.md"])
def test_links_beside_the_site_lead_to_files(document):
    text = (ROOT / document).read_text(encoding="utf-8")
    places = re.findall(r"\]\((?!https?:)([^)#]+)", text)
    assert places
    assert [place for place in places if not (ROOT / place).exists()] == []


def test_what_code_prints_and_its_last_value_follow_it():
    text = "Before\n\n```python run\nx = 6\nprint('said')\nx * 7\n```\n\n```python run\nx + 1\n```\n"
    page = execution.run_page(text)
    assert page.startswith("Before\n\n```python\nx = 6\n")
    assert page.index("said") < page.index("\n42\n") < page.index("\n7\n")


def test_a_table_is_shown_as_a_table():
    page = execution.run_page("```python run\nimport pandas as pd\npd.DataFrame({'a': [0.123456789]})\n```\n")
    assert "<td>0.1235</td>" in page


def test_a_figure_follows_its_code_with_words_for_those_who_do_not_see_it():
    code = "import matplotlib.pyplot as plt\nplt.plot([1, 2])\n"
    page = execution.run_page(f'```python run alt="a line"\n{code}```\n')
    assert '<img src="data:image/svg+xml;base64,' in page
    assert 'alt="a line"' in page
    with pytest.raises(execution.PageError, match="alt="):
        execution.run_page(f"```python run\n{code}```\n")


def test_a_page_runs_in_a_folder_of_its_own(here):
    execution.run_page("```python run\nfrom pathlib import Path\nPath('left').touch()\n```\n")
    assert not list(here.iterdir())
    assert Path.cwd() == here


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_code_that_fails_names_its_page_and_line():
    text = "# Title\n\n```python run\n1 / 0\n```\n"
    with pytest.raises(execution.PageError, match=r"(?s)page\.md, block of line 4.*ZeroDivisionError"):
        execution.run_page(text, "page.md")


def test_a_command_is_run_and_what_it_says_follows():
    page = execution.run_page("```console run tail=1\ntissuq --version  # the version\n```\n")
    assert page.endswith(f"``` {{ .text .output }}\ntissuq {tissuq.__version__}\n```\n\n")


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("```console run\ntissuq fit missing.csv\n```\n", "ends with status 2, not 0"),
        ("```console run exit=2\ntissuq --version\n```\n", "ends with status 0, not 2"),
        ("```console run\nrm file\n```\n", "only tissuq is run on a page"),
        ("```python run hidden\n1\n```\n", "'hidden' is no option"),
    ],
)
def test_a_block_that_is_not_as_expected_stops_the_build(block, words):
    with pytest.raises(execution.PageError, match=words):
        execution.run_page(block)


def test_code_that_is_hidden_still_runs():
    assert execution.run_page("```python run hide\nprint('said')\n```\n").count("print") == 0
    with pytest.raises(execution.PageError, match="AssertionError"):
        execution.run_page("```python run hide silent\nassert False\n```\n")


def test_every_tutorial_runs_code():
    tutorials = sorted((DOCS / "tutorials").glob("*.md"))
    assert len(tutorials) == 7
    assert all(execution.has_code(page.read_text(encoding="utf-8")) for page in [*tutorials, DOCS / "start.md"])


def test_percentages_are_written_with_a_space():
    """``{share:.0%}`` writes them without; options that are typed, such as ``stress=10%``, have none."""
    sources = [*(ROOT / "src" / "tissuq").rglob("*.py"), *(ROOT / "docs").glob("*.md")]
    without = [
        f"{path.name}: {found}"
        for path in sources
        for found in re.findall(r"[^{}]{0,30}:[+#]?\.?\d*%\}|\| *\d+%[^|]*\|", path.read_text(encoding="utf-8"))
    ]
    assert without == []


def test_a_number_stays_with_its_unit_in_tables_alone():
    text = "| 95 % | 1.2 ± 0.3 kPa | a b |\n\n95 % of it\n"
    assert formulas.with_whole_numbers(text) == "| 95\u00a0% | 1.2\u00a0±\u00a00.3\u00a0kPa | a b |\n\n95 % of it\n"


@pytest.mark.parametrize(
    "page",
    [
        '<script src="https://example.org/a.js"></script>',
        '<link rel="stylesheet" href="//example.org/a.css">',
        '<img src="https://example.org/a.png">',
        "<style>@font-face { src: url('https://example.org/a.woff2') }</style>",
        "<style>@import 'https://example.org/a.css';</style>",
        '<p style="background: url(https://example.org/a.png)">',
    ],
)
def test_what_a_browser_would_fetch_from_outside_is_found(page, tmp_path):
    (tmp_path / "page.html").write_text(page)
    assert len(offline.outside_addresses(tmp_path)) == 1


def test_links_that_a_reader_follows_and_what_is_in_the_site_are_not_taken_for_fetched(tmp_path):
    page = '<a href="https://example.org">there</a><img src="a.png"><link rel="stylesheet" href="a.css">'
    (tmp_path / "page.html").write_text(page)
    assert offline.outside_addresses(tmp_path) == []


def test_the_scripts_of_the_theme_are_taken_from_the_site(tmp_path):
    folder = tmp_path / "commands"
    folder.mkdir()
    (folder / "fit.html").write_text('<script src="https://unpkg.com/iframe-worker/shim"></script>')
    offline.make_local(tmp_path)
    assert (folder / "fit.html").read_text() == '<script src="../javascripts/iframe-worker.js"></script>'
    assert all((DOCS / place).exists() for place in offline.LOCAL.values())
