"""``tissuq app``: the page in a browser on this computer that reads, fits, compares, predicts and exports."""

from __future__ import annotations

from typing import Annotated

import typer

from tissuq.errors import InputError

__all__ = ["app"]


def app(
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page on this computer; 0 takes a free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Open a page in the browser for files of measurements: read, mend, fit, compare, predict, export."""
    try:
        from tissuq.app.server import serve
    except ModuleNotFoundError as missing:
        raise InputError(f"the page needs {missing.name}: pip install 'tissuq[app]'.") from missing
    serve(port, open_browser=browser)
