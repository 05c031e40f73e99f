"""FElupe, which is an extra, and how its absence is told."""

from __future__ import annotations

from typing import Any

from tissuq.errors import InputError

__all__ = ["felupe"]


def felupe() -> Any:
    """Return FElupe, imported when it is first needed.

    Raises
    ------
    InputError
        When it is not installed.
    """
    try:
        import felupe as library
    except ImportError as error:
        raise InputError(
            "finite elements need FElupe: install tissuq with its extra 'fe' (pip install 'tissuq[fe]')."
        ) from error
    return library
