"""Which test to make next: the variances that are expected after it."""

from tissuq.next_test.candidates import Candidate
from tissuq.next_test.ranking import rank_tests
from tissuq.next_test.targets import quantity_target

__all__ = ["Candidate", "quantity_target", "rank_tests"]
