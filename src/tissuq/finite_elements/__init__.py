"""Finite elements with the draws of a posterior: materials for FElupe, cases, and the uncertainty of what they give."""

from tissuq.finite_elements.case import Case, Mesh, Supports, cases
from tissuq.finite_elements.clamped_bar import ClampedBar
from tissuq.finite_elements.forces import bar_force, case_forces, indentation_force
from tissuq.finite_elements.indentation import Indentation
from tissuq.finite_elements.material import FElupeMaterial
from tissuq.finite_elements.response import Response, respond

__all__ = [
    "Case",
    "ClampedBar",
    "FElupeMaterial",
    "Indentation",
    "Mesh",
    "Response",
    "Supports",
    "bar_force",
    "case_forces",
    "cases",
    "indentation_force",
    "respond",
]
