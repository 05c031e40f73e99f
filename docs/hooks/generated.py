"""The pages that are made from the package: a page for each command, the public names, and the files beside docs/."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any, get_args, get_origin

ROOT = Path(__file__).parents[2]
ROOT_FILES = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changes.md"}
"""Files beside docs/ that are pages, too, and their names there."""

SECTIONS = {
    "posterior": "Fits and posteriors",
    "experiments": "Measurements",
    "mechanics": "Materials",
    "model": "Discrepancies, noise, errors of a test",
    "parameters": "Parameters and priors",
    "assessment": "Comparing",
    "next_test": "The next test",
    "population": "Populations",
    "emulation": "Expensive models",
    "finite_elements": "Finite elements",
    "studies": "Runs and studies",
    "report": "Material cards",
    "errors": "Errors",
}
"""The stages of the package that have public names, in the order of the pages; any other is named by itself."""

GUIDES = {
    "fit": ["tutorials/one-test.md", "reading.md", "several-tests.md", "which-law.md"],
    "inspect": ["reading.md", "reading-steps.md", "what-is-looked-for.md"],
    "paper": ["tutorials/paper.md"],
    "predict": ["prediction.md"],
    "population": ["tutorials/populations.md", "populations.md"],
    "calibrate": ["tutorials/expensive-models.md", "expensive-models.md"],
    "compare": ["rivals.md"],
    "design": ["design.md"],
    "export": ["tutorials/cards.md", "cards.md"],
    "structure": ["finite-elements.md"],
    "materials": ["materials.md"],
    "modes": ["modes.md"],
    "check": ["contributing.md"],
    "study": ["coverage.md"],
    "init": ["start.md"],
    "doctor": ["start.md"],
    "discrepancies": ["what-it-computes.md", "energy.md"],
    "datasets": ["gallery.md"],
    "show": ["by-example.md"],
    "app": ["app.md"],
    "schema": ["by-example.md"],
}
"""The pages to read beside that of a command."""


def commands() -> dict[str, Any]:
    """Return every command that is shown in the help by its whole name, such as ``study coverage``."""
    from typer.main import get_command

    from tissuq.cli.app import app

    return dict(_leaves("", get_command(app)))


def _leaves(prefix: str, command: Any) -> Iterator[tuple[str, Any]]:
    for name, each in getattr(command, "commands", {}).items():
        if each.hidden:
            continue
        whole = f"{prefix}{name}"
        if getattr(each, "commands", None):
            yield from _leaves(f"{whole} ", each)
        else:
            yield whole, each


def command_pages() -> dict[str, str]:
    """Return the pages of the commands by their addresses, that of the list of commands first."""
    known = commands()
    rows = [f"| [`tissuq {name}`]({_slug(name)}) | {_first_sentence(each)} |" for name, each in known.items()]
    text = [
        "# Commands",
        "",
        "Each page is made from the command itself. `tissuq COMMAND --help` says the same. Exit status 2 means that "
        "the input cannot be used (one message says why), 3 that sampling has not converged.",
        "",
        "| command | what it does |",
        "|---|---|",
        *rows,
    ]
    pages = {"commands/index.md": "\n".join(text) + "\n"}
    for name, each in known.items():
        pages[f"commands/{_slug(name)}"] = command_page(name, each)
    return pages


def command_page(name: str, command: Any) -> str:
    """Return the page of a command: what it does, its arguments and its options."""
    shown = [parameter for parameter in command.params if not getattr(parameter, "hidden", False)]
    options = [parameter for parameter in shown if is_option(parameter)]
    arguments = [parameter for parameter in shown if not is_option(parameter)]
    usage = " ".join([f"tissuq {name}", *(["[OPTIONS]"] if options else []), *map(_argument_name, arguments)])
    help_text = inspect.cleandoc(command.help or "").replace("\f", "")
    lines = [f"# tissuq {name}", "", help_text, "", "```text", usage, "```", ""]
    guides = GUIDES.get(name, GUIDES.get(name.split()[0], []))
    if guides:
        lines += ["Read also: " + ", ".join(f"[{_title(page)}](../{page})" for page in guides) + ".", ""]
    settings = _settings(name.split()[-1])
    if settings:
        lines += [
            "A file for `--config` has the settings that stand in brackets, or else those of the options' names, with "
            f"`_` for `-`; `tissuq schema {name.split()[-1]}` prints their types.",
            "",
        ]
    by_title: dict[str, list[Any]] = {"Arguments": arguments, "Options": []}
    for option in options:
        by_title.setdefault(getattr(option, "rich_help_panel", None) or "Options", []).append(option)
    for title, parameters in by_title.items():
        if parameters:
            items = [_definition(parameter, settings) for parameter in parameters]
            lines += [f"## {title}", "", '<dl class="options">', *items, "</dl>", ""]
    return "\n".join(lines)


def _settings(name: str) -> dict[str, str]:
    """Return the setting of every parameter of a command, where it has another name or a unit."""
    from tissuq.cli.command import settings_of
    from tissuq.studies.option import slots_of

    kind = settings_of(name)
    remarks = {}
    for slot in slots_of(kind) if kind is not None else ():
        setting, unit = ".".join(slot.path), f" in {slot.option.unit}" if slot.option.unit else ""
        remarks[slot.name] = f"<code>{setting}</code>{unit}" if setting != slot.name or unit else ""
    return remarks


def _slug(name: str) -> str:
    return f"{name.replace(' ', '-')}.md"


def _title(page: str) -> str:
    from_root = {place: name for name, place in ROOT_FILES.items()}
    file = ROOT / from_root[page] if page in from_root else ROOT / "docs" / page
    return page_title(file.read_text(encoding="utf-8"))


def page_title(text: str) -> str:
    """Return the first heading of a page."""
    found = re.search(r"^# (.+)$", text, flags=re.MULTILINE)
    return found[1] if found else ""


def _first_sentence(command: Any) -> str:
    paragraph = " ".join(inspect.cleandoc(command.help or "").partition("\n\n")[0].split())
    return paragraph.replace("|", "\\|")


def is_option(parameter: Any) -> bool:
    """Return whether a parameter of a command is an option, not an argument."""
    return all(name.startswith("-") for name in parameter.opts)


def _argument_name(parameter: Any) -> str:
    name = parameter.name.upper() + ("..." if parameter.nargs == -1 else "")
    return name if parameter.required else f"[{name}]"


def _definition(parameter: Any, settings: Mapping[str, str]) -> str:
    if is_option(parameter):
        names = [*parameter.opts, *parameter.secondary_opts]
        anchor = names[0].lstrip("-")
        word, is_repeated = _taken_by(parameter)
        kind = (f" <code>{escape(word)}</code>" if word else "") + (" <em>may be repeated</em>" if is_repeated else "")
    else:
        names, anchor, kind = [_argument_name(parameter)], parameter.name, ""
    code = ", ".join(f"<code>{escape(name)}</code>" for name in names)
    default = "" if parameter.default in (None, (), [], False, True) else f" [{escape(str(parameter.default))}]"
    if setting := settings.get(parameter.name):
        kind += f" <em>({setting})</em>"
    return f'<dt id="{escape(anchor)}">{code}{kind}</dt><dd>{escape(parameter.help or "")}{default}</dd>'


def _taken_by(parameter: Any) -> tuple[str, bool]:
    """Return the word for what an option takes (none for a flag), and whether it may be repeated."""
    if not hasattr(parameter, "type_descriptor"):  # Typer that is built on click
        words = {"boolean": "", "path": "PATH", "integer": "NUMBER", "float": "NUMBER"}
        return words.get(parameter.type.name, "TEXT"), parameter.multiple
    annotation = parameter.type_descriptor.annotation
    inner = next((part for part in get_args(annotation) if part is not type(None)), annotation)
    choices = "|".join(map(str, get_args(inner)))
    words = {bool: "", Path: "PATH", int: "NUMBER", float: "NUMBER"}
    return choices or words.get(inner, "TEXT"), get_origin(annotation) is list


def public_names() -> dict[str, str]:
    """Return the public names of the package, and the modules that they are imported from."""
    stubs = (ROOT / "src" / "tissuq" / "__init__.pyi").read_text(encoding="utf-8")
    return {
        alias.name: statement.module
        for statement in ast.parse(stubs).body
        if isinstance(statement, ast.ImportFrom) and statement.module
        for alias in statement.names
    }


def reference_pages() -> dict[str, str]:
    """Return the pages of the public names by their addresses: one for each stage that has some, and a list of all."""
    by_stage: dict[str, list[str]] = {}
    for name, module in public_names().items():
        stage = name if module == "tissuq" else module.split(".")[1]
        by_stage.setdefault(stage, []).append(name)
    stages = [*(stage for stage in SECTIONS if stage in by_stage), *sorted(set(by_stage) - set(SECTIONS))]
    pages = {}
    lines = ["# Python reference", "", "```python", "import tissuq as tq", "```", ""]
    for stage in stages:
        title, names = SECTIONS.get(stage, stage), sorted(by_stage[stage], key=str.lower)
        page = f"{stage.replace('_', '-')}.md"
        lines += [f"**[{title}]({page})**", "", ", ".join(f"[`{name}`][tissuq.{name}]" for name in names), ""]
        pages[f"reference/{page}"] = "\n".join([f"# {title}", "", *(_identifier(name) for name in names), ""])
    return {"reference/index.md": "\n".join(lines), **pages}


def _identifier(name: str) -> str:
    import tissuq

    value = getattr(tissuq, name)
    if inspect.ismodule(value):
        elsewhere = public_names()
        listed = "\n".join(f"        - {each}" for each in value.__all__ if each not in elsewhere)
        return f"::: tissuq.{name}\n    options:\n      members:\n{listed}\n"
    return f"::: tissuq.{name}\n"


def root_pages() -> dict[str, str]:
    """Return the files beside docs/ that are pages, with their links as they are in the site."""
    pages = {}
    for file, page in ROOT_FILES.items():
        text = (ROOT / file).read_text(encoding="utf-8")
        pages[page] = re.sub(r"\]\(docs/", "](", linked_in_site(text, prefix=""))
    return pages


def linked_in_site(text: str, prefix: str = "../") -> str:
    """Return a page whose links to files beside docs/ lead to the pages made from them."""
    for file, page in {**ROOT_FILES, "README.md": "index.md"}.items():
        text = text.replace(f"]({prefix}{file}", f"]({page}")
    return text


def all_pages() -> dict[str, str]:
    """Return every page that is made, by its address in the site."""
    return {**command_pages(), **reference_pages(), **root_pages()}
