"""Variants by name: every concrete subclass with a ``name``, wherever it was defined, and those of other packages.

A base class whose variants other packages may add names a group of entry points, ``entry_point_group``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from inspect import isabstract
from typing import Any, TypeVar
from warnings import warn

from tissuq.errors import ModelError, TissuqError

T = TypeVar("T")


def variants(base: type[T]) -> dict[str, type[T]]:
    """Return the concrete subclasses of a base class by their ``name``, in the order of definition.

    A class that is defined again under the same module and class name (as in a notebook) replaces the earlier one.

    Raises
    ------
    ModelError
        When two different classes have the same name.
    """
    classes: dict[str, type[T]] = {}
    for subclass in _descendants(base):
        name = vars(subclass)["name"]
        if name in classes and _origin(classes[name]) != _origin(subclass):
            raise ModelError(
                f"two classes are named '{name}': {' and '.join(map(_origin, (classes[name], subclass)))}. "
                "Give yours another name."
            )
        classes[name] = subclass
    return classes


def _descendants(base: type[T]) -> Iterator[type[T]]:
    level = base.__subclasses__()
    while level:
        yield from (kind for kind in level if not isabstract(kind) and isinstance(vars(kind).get("name"), str))
        level = [child for kind in level for child in kind.__subclasses__()]


def _origin(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def find(base: type[T], kind: str, name: str, error: type[TissuqError], further_names: Iterable[str] = ()) -> type[T]:
    """Return the variant of that name, or raise ``error`` that lists the names there are, and further ones."""
    classes = variants(base)
    if isinstance(name, str) and name in classes:
        return classes[name]
    for plugin in plugins(base, str(name)):
        return plugin
    text, names = str(name).lower(), [*classes, *further_names]
    family = [full for full in names if text and full.startswith(f"{text}-")]
    abbreviated = [full for full in names if "".join(word[0] for word in full.split("-")) == text]
    close = family or abbreviated or get_close_matches(text, names, n=1)
    hint = f" Did you mean {' or '.join(map(repr, close))}?" if close else ""
    raise error(f"there is no {kind} named '{name}'.{hint} Choose one of: {', '.join(names)}.")


def plugins(base: type[T], name: str | None = None) -> list[type[T]]:
    """Return the variants of a base class that other packages add, or the one under that entry point.

    Once loaded they are among its `variants`, too.

    Raises
    ------
    ModelError
        As `load_plugins`.
    """

    def accept(plugin: Any, source: str) -> type[T]:
        if not (isinstance(plugin, type) and issubclass(plugin, base)):
            raise ModelError(f"{source} is not a subclass of {_origin(base)}")
        if missing := [name for name in _required(base) if not hasattr(plugin, name)]:
            raise ModelError(f"the class has no {' and no '.join(missing)}")
        return plugin

    group = getattr(base, "entry_point_group", "")
    return load_plugins(group, accept, name) if group else []


def _required(base: type) -> list[str]:
    """Return what every variant must have, beside its name: what the base class declares without a value."""
    declared = [item for kind in base.__mro__ for item in vars(kind).get("__annotations__", {}).items()]
    return [name for name, kind in declared if "ClassVar" in str(kind) and name != "name" and not hasattr(base, name)]


def load_plugins(group: str, accept: Callable[[Any, str], T], name: str | None = None) -> list[T]:
    """Return the objects under a group of entry points, each as ``accept`` returns it for the object and its source.

    Of a whole group, one that cannot be loaded is warned of and left out, so that it does not take the others away.

    Raises
    ------
    ModelError
        When the one of that name cannot be loaded, or one is not accepted.
    """
    accepted = []
    for point in entry_points(group=group) if name is None else entry_points(group=group, name=name):
        try:
            loaded = point.load()
        except Exception as error:
            if name is not None:
                raise _unusable(point, error) from error
            warn(str(_unusable(point, error)), stacklevel=2)
            continue
        try:
            accepted.append(accept(loaded, point.value))
            if (name_of_class := getattr(accepted[-1], "name", point.name)) != point.name:
                raise ModelError(f"what it names calls itself '{name_of_class}': give both one name")
        except Exception as error:
            raise _unusable(point, error) from error
    return accepted


def _unusable(point: EntryPoint, error: Exception) -> ModelError:
    return ModelError(
        f"'{point.name}' of another package ({point.group}: {point.value}) cannot be used: {error}. Repair or "
        "uninstall that package."
    )
