"""To what extent a model is wrong, and what the answer rests on."""

from tissuq.assessment.comparison import Average, average, compare
from tissuq.assessment.extent import Assessment, assess
from tissuq.assessment.measurements import measurement_warnings
from tissuq.assessment.sensitivity import PowerScaling, known_evidence_changes

__all__ = [
    "Assessment",
    "Average",
    "PowerScaling",
    "assess",
    "average",
    "compare",
    "known_evidence_changes",
    "measurement_warnings",
]
