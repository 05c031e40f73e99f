"""Whether predictions of real tissue hold: tests of measured data sets, each predicted from others."""

from tissuq.validation.tissues.benchmark import run_benchmark, summarise_tissues
from tissuq.validation.tissues.corpus import TissueSet, read_corpus
from tissuq.validation.tissues.settings import TissueSettings

__all__ = ["TissueSet", "TissueSettings", "read_corpus", "run_benchmark", "summarise_tissues"]
