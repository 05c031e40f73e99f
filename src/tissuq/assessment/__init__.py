"""To what extent a model is wrong, and what the answer rests on."""

from tissuq.assessment.averaging import Average, average
from tissuq.assessment.candidates import Candidate
from tissuq.assessment.comparison import compare
from tissuq.assessment.design import design_warnings
from tissuq.assessment.extent import Assessment, assess
from tissuq.assessment.ranking import rank_tests
from tissuq.assessment.sensitivity import PowerScaling, known_evidence_changes

__all__ = [
    "Assessment",
    "Average",
    "Candidate",
    "PowerScaling",
    "assess",
    "average",
    "compare",
    "design_warnings",
    "known_evidence_changes",
    "rank_tests",
]
