"""To what extent a model is wrong, and what the answer rests on."""

from tissuq.assessment.comparison import compare
from tissuq.assessment.design import design_warnings
from tissuq.assessment.extent import Assessment, assess

__all__ = ["Assessment", "assess", "compare", "design_warnings"]
