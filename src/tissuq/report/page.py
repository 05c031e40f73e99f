"""HTML pages that open offline: templates, with every figure inside the page."""

from __future__ import annotations

import platform
from base64 import b64encode
from importlib.metadata import version
from pathlib import Path
from typing import Any

__all__ = ["embedded_figure", "render", "versions"]

LIBRARIES = ("tissuq", "numpy", "scipy", "jax", "blackjax", "arviz-stats", "xarray", "matplotlib")


def render(template: str, **context: Any) -> str:
    """Return a page from a template of this package; every value is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("tissuq.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template(template).render(versions=versions(), **context)


def embedded_figure(path: Path) -> str:
    """Return an SVG file as a data address for an image in a page."""
    return "data:image/svg+xml;base64," + b64encode(path.read_bytes()).decode("ascii")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries on which numbers depend."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}
