"""The study of section 5 of Zeraatpisheh, Bordas & Beex (2021), with each claim of the paper checked."""

from tissuq.validation.paper.study import FORMULATIONS, PaperSettings, PaperStudy, run_paper

__all__ = ["FORMULATIONS", "PaperSettings", "PaperStudy", "run_paper"]
