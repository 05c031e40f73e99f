"""To what extent a model is wrong, and what the answer rests on."""

from tissuq.assessment.averaging import Average, average
from tissuq.assessment.comparison import compare
from tissuq.assessment.design import design_warnings
from tissuq.assessment.extent import Assessment, assess

__all__ = ["Assessment", "Average", "assess", "average", "compare", "design_warnings"]
