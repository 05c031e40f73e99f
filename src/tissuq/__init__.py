"""tissuq: parameters of hyperelastic soft-tissue models, with uncertainty that can be trusted.

The public names stand in ``__init__.pyi``, each beside the module that it is imported from when it is first used.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_MODULES = {
    alias.name: statement.module
    for statement in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(statement, ast.ImportFrom) and statement.module
    for alias in statement.names
}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("tissuq")
    elif name in _MODULES:
        module = import_module(_MODULES[name])
        value = vars(module)[name] if name in vars(module) else import_module(f"{_MODULES[name]}.{name}")
    else:
        raise AttributeError(f"module 'tissuq' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
