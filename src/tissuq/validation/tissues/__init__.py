"""Whether predictions of real tissue hold: tests of measured data sets, each predicted from others."""

from tissuq.validation.tissues.benchmark import TissueSettings, run_benchmark, summarise_tissues, summarise_verdicts
from tissuq.validation.tissues.corpus import TissueSet, read_corpus

__all__ = ["TissueSet", "TissueSettings", "read_corpus", "run_benchmark", "summarise_tissues", "summarise_verdicts"]
