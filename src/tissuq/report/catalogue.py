"""The pages of all materials and of all loading modes, written from their classes."""

from __future__ import annotations

from inspect import getdoc
from math import inf

from tissuq.experiments.modes import LoadingMode, loading_modes
from tissuq.mechanics.material import Material, materials
from tissuq.mechanics.named import FORMS
from tissuq.parameters.parameter import Parameter

MATERIALS_HEAD = """# Materials

Written by `tissuq materials --markdown` from the classes; a test holds it up to date. W is the strain energy per
undeformed volume, I1 and I2 the invariants of the right Cauchy-Green tensor, l1, l2, l3 the principal stretches, I4
the squared stretch along fibres; every material is incompressible, and every stress is a derivative of W. Linear
parameters, to which the stress is proportional, are integrated in closed form. A limit Jm is never inside the data: a
specimen that was stretched so far has not locked.
"""
MATERIALS_PACKAGE = "tissuq.mechanics.laws."
SCALES = {
    "stress": " x the largest stress",
    "stretch": " x the stretch range",
    "modulus": " x the pilot C10",
    "limit": " x the largest I1 - 3",
    "rate": " / the largest I1 - 3",
}


def materials_page() -> str:
    """Return the page in Markdown: of the library's own materials, not of those that others have added."""
    forms = "\n".join(f"- `{form.partition(' (')[0]}` {form[form.index(' (') + 1 :]}" for form in FORMS)
    library = [kind for kind in materials().values() if kind.__module__.startswith(MATERIALS_PACKAGE)]
    return "\n".join(
        [MATERIALS_HEAD, f"Names that are not in the list:\n\n{forms}\n", *map(_material_section, library)]
    )


def default_in_words(parameter: Parameter) -> str:
    """Return the default prior of a parameter; the data set its scale."""
    if parameter.relative_prior is None:
        side = "positive, " if parameter.support[0] == 0 else ""
        return f"uniform, {side}to 10 times beyond least squares"
    return f"{parameter.relative_prior}{SCALES.get(parameter.dimension, '')}"


def _material_section(kind: type[Material]) -> str:
    head = f"## {kind.name}\n", f"    W = {kind.formula}\n", (getdoc(kind) or "").replace("``", "`") + "\n"
    note = [f"{kind.caution}\n"] if kind.caution else []
    table = ["| parameter | unit | | linear | values | default prior |", "|---|---|---|---|---|---|"]
    for p in kind.parameters:
        cells = p.symbol, p.unit or "-", p.description, "yes" if p.is_linear else "no", _range(p), default_in_words(p)
        table.append(f"| {' | '.join(cells)} |")
    return "\n".join([*head, *note, *table, f"\nSource: {kind.source}.\n"])


def _range(parameter: Parameter) -> str:
    low, high = parameter.support
    if parameter.dimension == "limit":
        lower_bound = f", more than {low:g}" if low else ""
        return f"beyond the data{lower_bound}"
    if (low, high) == (-inf, inf):
        return "any"
    return f"{low:g} or more" if high == inf else f"{low:g} to {high:g}"


MODES_HEAD = """# Loading modes

Written by `tissuq modes --markdown` from the classes; a test holds it up to date. F is the deformation gradient, l a
stretch (deformed over undeformed length), g an amount of shear, W the strain energy per undeformed volume. Every mode
keeps the volume. A measured stress is the derivative of W by what it does work on, shared by the axes that carry it:
engineering stress (force over undeformed area), tension positive.
"""
MODES_PACKAGE = "tissuq.experiments.modes."


def modes_page() -> str:
    """Return the page in Markdown: of the library's own modes, not of those that others have added."""
    library = [kind for kind in loading_modes().values() if kind.__module__.startswith(MODES_PACKAGE)]
    return "\n".join([MODES_HEAD, *map(_mode_section, library)])


def _mode_section(kind: type[LoadingMode]) -> str:
    controls = [f"{control.name} ({control.reference:g} at rest)" for control in kind.controls]
    return "\n".join(
        [
            f"## {kind.name}\n",
            (getdoc(kind) or "").replace("``", "`") + "\n",
            f"Set: {', '.join(controls)}. Measured: {', '.join(kind.stresses)}.\n",
        ]
    )
