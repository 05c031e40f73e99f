"""Run the code of a page and put what it prints, shows and draws below it.

A fenced block whose first line says ``python run`` is run, with all others of its page in one namespace and one new
folder; what it prints, its last expression and its Matplotlib figures follow it. ``console run`` does the same for
lines that call ``tissuq``. ``figure run`` shows a picture that was written. Words behind ``run``: ``hide`` (the code
is not shown), ``silent`` (what it says is not shown), ``tail=8`` (only the last lines), ``exit=2`` (the status that
is expected) and ``alt="..."``, which says in words what a figure shows. An error stops the build.
"""

from __future__ import annotations

import ast
import base64
import io
import os
import re
import shlex
import sys
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from html import escape
from pathlib import Path
from time import process_time
from typing import Any

BLOCK = re.compile(r"^```(python|console|figure) run\b([^\n]*)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
TYPES = {".png": "image/png", ".svg": "image/svg+xml"}


class PageError(Exception):
    """Code on a page failed: says which page, which line and why."""


@dataclass(frozen=True)
class Options:
    """What stands behind ``run`` in the first line of a block."""

    hide: bool = False
    silent: bool = False
    tail: int | None = None
    exit: int = 0
    alt: str = ""

    @classmethod
    def read(cls, text: str) -> Options:
        """Return the options in a line; an unknown one is an error."""
        found: dict[str, Any] = {}
        for word in shlex.split(text):
            name, has_value, value = word.partition("=")
            if name in ("hide", "silent") and not has_value:
                found[name] = True
            elif name in ("tail", "exit") and has_value:
                found[name] = int(value)
            elif name == "alt" and value:
                found[name] = value
            else:
                raise ValueError(f"'{word}' is no option of a block that is run")
        return cls(**found)


def has_code(text: str) -> bool:
    """Return whether a page has a block that is to be run."""
    return BLOCK.search(text) is not None


def run_page(text: str, name: str = "page") -> str:
    """Return a page with what its code says and draws below each block.

    Raises
    ------
    PageError
        When a block fails, or a command ends with another status than the one that is expected.
    """
    import matplotlib
    import matplotlib.pyplot as plt

    matplotlib.use("agg")
    plt.close("all")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    pieces, done = [], 0
    with _new_folder():
        for block in BLOCK.finditer(text):
            line = text.count("\n", 0, block.start()) + 2
            language, words, code = block.groups()
            try:
                options = Options.read(words)
                shown = {"python": _run_python, "console": _run_console, "figure": _show_file}[language](
                    code, options, namespace
                )
            except (Exception, SystemExit) as error:
                said = "".join(traceback.format_exception(error)[-3:])
                raise PageError(f"{name}, block of line {line}: {said}") from error
            source = "" if options.hide or language == "figure" else f"```{language}\n{code}```\n"
            pieces += [text[done : block.start()], source, shown]
            done = block.end()
    return "".join([*pieces, text[done:]])


def timed_page(text: str, name: str) -> tuple[str, float]:
    """Return what `run_page` returns, and the seconds of a processor that it took."""
    start = process_time()
    return run_page(text, name), process_time() - start


@contextmanager
def _new_folder() -> Iterator[None]:
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def _run_python(code: str, options: Options, namespace: dict[str, Any]) -> str:
    import matplotlib.pyplot as plt

    statements = ast.parse(code).body
    last = statements.pop() if statements and isinstance(statements[-1], ast.Expr) else None
    said, value = io.StringIO(), None
    with redirect_stdout(said):
        exec(compile(ast.Module(statements, []), "page", "exec"), namespace)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "page", "eval"), namespace)
    pictures = []
    for number in plt.get_fignums():
        if not options.alt:
            raise ValueError('a figure needs words for those who do not see it: alt="..." behind run')
        drawn = io.BytesIO()
        plt.figure(number).savefig(drawn, format="svg", bbox_inches="tight", metadata={"Date": None})
        pictures.append(_picture(drawn.getvalue(), ".svg", options.alt))
    plt.close("all")
    if options.silent:
        return "".join(pictures)
    output = _output(said.getvalue(), options, "output wrapped")
    return output + _shown(value, has_figure=bool(pictures)) + "".join(pictures)


def _run_console(code: str, options: Options, namespace: dict[str, Any]) -> str:
    said = io.StringIO()
    for line in code.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if not words:
            continue
        if words[0] != "tissuq":
            raise ValueError(f"only tissuq is run on a page, not '{words[0]}'")
        status = _command(words[1:], said)
        if status != options.exit:
            raise ValueError(f"'{line}' ends with status {status}, not {options.exit}:\n{said.getvalue()}")
    return "" if options.silent else _output(said.getvalue(), options)


def _command(arguments: list[str], said: io.StringIO) -> int:
    """Run a command in this process, as the program does, and return its exit status."""
    from tissuq.cli.app import main

    given = sys.argv
    try:
        sys.argv = ["tissuq", *arguments]
        with redirect_stdout(said), redirect_stderr(said):
            main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    finally:
        sys.argv = given
    return 0


def _show_file(code: str, options: Options, namespace: dict[str, Any]) -> str:
    if not options.alt:
        raise ValueError('a figure needs words for those who do not see it: alt="..." behind run')
    file = Path(code.strip())
    return _picture(file.read_bytes(), file.suffix, options.alt)


def _picture(content: bytes, suffix: str, alt: str) -> str:
    address = f"data:{TYPES[suffix]};base64,{base64.b64encode(content).decode()}"
    return f'\n<p class="figure"><img src="{address}" alt="{escape(alt, quote=True)}"></p>\n'


def _output(said: str, options: Options, kind: str = "output") -> str:
    import tissuq

    for folder in (Path.cwd(), Path(tissuq.__file__).parents[1]):
        said = said.replace(f"{folder}{os.sep}", "")
    lines = [line.rstrip() for line in said.rstrip().splitlines()]
    if options.tail is not None:
        lines = lines[-options.tail :]
    return _verbatim("\n".join(lines), kind) if lines else ""


def _shown(value: object, *, has_figure: bool) -> str:
    """Return a value as a notebook shows it: a table as a table, anything else by its text."""
    import pandas as pd

    if value is None or (has_figure and not isinstance(value, pd.DataFrame)):
        return ""
    if isinstance(value, pd.Series):
        value = value.to_frame()
    if isinstance(value, pd.DataFrame):
        table = " ".join(value.to_html(border=0, float_format="{:.4g}".format, na_rep="").split())
        plain = re.sub(r"<(table|tr) [^>]*>", r"<\1>", table)  # the theme's own style
        return f'\n<div class="output-table">{plain}</div>\n'
    return _verbatim(repr(value), "output wrapped")


def _verbatim(text: str, kind: str) -> str:
    classes = " ".join(f".{name}" for name in ("text", *kind.split()))
    return f"\n``` {{ {classes} }}\n{text}\n```\n"
