"""Write the table of files in architecture.md from the first lines of their docstrings."""

from __future__ import annotations

import ast
import re
from itertools import groupby
from pathlib import Path

PAGE = Path(__file__).with_name("architecture.md")
SOURCE = Path(__file__).parents[1] / "src" / "tissuq"
BEGIN, END = "<!-- files: begin -->\n", "<!-- files: end -->\n"


def first_line(file: Path) -> str:
    """Return the first line of a module's docstring."""
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0].rstrip(".")


def table(stages: list[str]) -> str:
    """Return every folder in the order of the stages, and every file in it with what it is."""
    lines = []
    files = sorted(SOURCE.rglob("*.py"), key=lambda file: (file.parent.parts, file.name != "__init__.py", file.name))
    by_stage = {
        stage: list(group) for stage, group in groupby(files, key=lambda file: file.relative_to(SOURCE).parts[0])
    }
    for stage in [name for name in stages if name in by_stage]:
        package = SOURCE / stage / "__init__.py"
        lines += [f"### {stage}", "", f"{first_line(package)}.", "", "| file | what it is |", "|---|---|"]
        for file in by_stage[stage]:
            name = str(file.relative_to(SOURCE / stage)).removesuffix("__init__.py")
            if file != package:
                lines.append(f"| `{name}` | {first_line(file).replace('|', chr(92) + '|')} |")
        lines.append("")
    return "\n".join(lines)


def page(text: str, stages: list[str]) -> str:
    """Return the page with its table as the source has it."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table(stages)}\n{END}{after}"


def stages_of(text: str) -> list[str]:
    """Return the stages in the order in which the page draws them."""
    drawing = text.partition("# Architecture")[2].partition("\nEach stage")[0]
    return re.findall(r"(?:^|[ >])([a-z_]+)(?= +->| *$)", drawing, flags=re.MULTILINE)


if __name__ == "__main__":
    words = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page(words, stages_of(words)), encoding="utf-8")
