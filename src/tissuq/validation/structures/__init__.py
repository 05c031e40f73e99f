"""Whether bands of the force of a structure hold: simple tests of a known law, and the structure with their fit."""

from tissuq.validation.structures.campaign import run_structures, summarise_structures, tasks_of
from tissuq.validation.structures.settings import StructureStudySettings

__all__ = ["StructureStudySettings", "run_structures", "summarise_structures", "tasks_of"]
