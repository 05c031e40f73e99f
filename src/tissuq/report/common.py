"""What the run folders of all studies share: tables, posteriors, figures and the recipe."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.experiments.experiment import Experiment
from tissuq.mechanics.user_law import LAW
from tissuq.posterior import Posterior
from tissuq.report.run_folder import INPUT, RECIPE
from tissuq.report.tables import Row, parameter_rows, write_csv, write_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pydantic import BaseModel

__all__ = ["copied_laws", "write_data", "write_figures", "write_posteriors", "write_recipe", "write_tables"]


def write_data(folder: Path, experiment: Experiment) -> None:
    """Write the measurements as fitted: stretch and engineering stress in MPa, in full precision.

    Of several tests with the name of each and its mode.
    """
    rows: list[Row] = []
    for test, number, stresses in experiment.curves:
        own = {"test": test.name, "mode": test.mode.name, "measured": test.mode.stresses[number]}
        at = test.mode.channels[number].abscissa(test.stretch)
        pairs = zip(map(float, at), map(float, stresses), strict=True)
        several = own if len(experiment.curves) > 1 else {}
        rows += [several | {"stretch": stretch, "stress": stress} for stretch, stress in pairs]
    write_csv(folder / "data.csv", rows)


def write_tables(folder: Path, summary: list[Row], posteriors: Mapping[str, Posterior], suffix: str = "") -> None:
    """Write summary.csv, summary.json and parameters.csv."""
    write_csv(folder / f"summary{suffix}.csv", summary)
    write_json(folder / f"summary{suffix}.json", summary)
    write_csv(folder / f"parameters{suffix}.csv", parameter_rows(posteriors))


def write_posteriors(folder: Path, posteriors: Mapping[str, Posterior], suffix: str = "") -> None:
    """Write one NetCDF file a formulation."""
    (folder / "posterior").mkdir(exist_ok=True)
    for name, posterior in posteriors.items():
        posterior.save(folder / "posterior" / f"{name}{suffix}.nc")


def write_figures(folder: Path, figures: Mapping[str, Figure]) -> None:
    """Write every figure as SVG and PNG."""
    from tissuq.report.figures import save_figure

    (folder / "figures").mkdir()
    for name, figure in figures.items():
        save_figure(figure, folder / "figures", name)


def write_recipe(folder: Path, command: str, settings: BaseModel, without: frozenset[str] = frozenset()) -> None:
    """Write run.toml, from which ``tissuq COMMAND --config`` repeats the run; ``without`` settings of no meaning."""
    import tomli_w

    plain: dict[str, Any] = settings.model_dump(mode="json", exclude_none=True, exclude=set(without))
    header = f"# Repeat this run: tissuq {command} --config {RECIPE} --out ANOTHER_FOLDER\n"
    (folder / RECIPE).write_text(header + tomli_w.dumps(plain), encoding="utf-8")


def copied_laws(material: str, folder: Path) -> str:
    """Return the name of a material with the laws in the user's files, of which copies go with the run."""
    parts = material.split("+")
    for place, match in enumerate(map(LAW.fullmatch, parts)):
        if match:
            law = Path(match["path"].strip())
            shutil.copyfile(law, folder / INPUT / law.name)
            parts[place] = f"{INPUT}/{law.name}:{match['name']}"
    return "+".join(parts)
