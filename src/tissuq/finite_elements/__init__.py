"""Finite elements with the draws of a posterior: materials for FElupe, cases, and the uncertainty of what they give."""

from tissuq.finite_elements.bodies import ClampedBar, Indentation, PlateWithHole, SphericalIndentation
from tissuq.finite_elements.body_from_file import BodyFromFile, InflatedBody
from tissuq.finite_elements.case import Case, Mesh, RigidTip, Supports, cases
from tissuq.finite_elements.material import FElupeMaterial
from tissuq.finite_elements.response import Response, bar_force, case_forces, indentation_force, respond
from tissuq.finite_elements.simulation import Simulation, simulate
from tissuq.finite_elements.spread import Band, Shares, band_of, shares_of
from tissuq.posterior.draws_in_words import FailedDraw

__all__ = [
    "Band",
    "BodyFromFile",
    "Case",
    "ClampedBar",
    "FElupeMaterial",
    "FailedDraw",
    "Indentation",
    "InflatedBody",
    "Mesh",
    "PlateWithHole",
    "Response",
    "RigidTip",
    "Shares",
    "Simulation",
    "SphericalIndentation",
    "Supports",
    "band_of",
    "bar_force",
    "case_forces",
    "cases",
    "indentation_force",
    "respond",
    "shares_of",
    "simulate",
]
