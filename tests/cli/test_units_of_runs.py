"""What a run leaves is in the unit of the file, or a smaller one, and says so; what to do with earlier runs."""

from __future__ import annotations

import json

import pytest

import tissuq as tq

from .conftest import rows_of


@pytest.fixture
def run(done, here, specimen):
    done("fit", specimen, "--discrepancy", "none", "--prior", "C10=normal(40,30)", "--no-figures", "--out", "run")
    return here / "run"


def test_tables_of_a_run_are_in_the_unit_of_the_file(run):
    marginal = tq.load(run).marginals["C10"]
    (summary,), (plain,) = rows_of(run / "summary.csv"), json.loads((run / "summary.json").read_text())
    for name, value in {"mean": marginal.mean, "sd": marginal.sd, "hdi_low": marginal.hdi()[0]}.items():
        assert float(summary[f"C10_{name} [kPa]"]) == pytest.approx(1e3 * value, rel=1e-9)
        assert plain[f"C10_{name}"] == pytest.approx(1e3 * value, rel=1e-9)
    assert plain["unit"] == "kPa"
    c10 = next(row for row in rows_of(run / "parameters.csv") if row["parameter"] == "C10")
    assert (c10["unit"], c10["prior"]) == ("kPa", "normal(40, 30, low=0)")
    assert float(c10["median"]) == pytest.approx(1e3 * marginal.quantile(0.5), rel=1e-9)


@pytest.fixture
def soft(done, here, specimen):
    """The same measurements in MPa, the largest of which is 0.05, with noise and prior in MPa, too."""
    data = tq.read(specimen, unit="kPa")
    rows = "".join(f"{x!r},{y!r}\n" for x, y in zip(data.stretch.tolist(), data.stress.tolist(), strict=True))
    (here / "soft.csv").write_text(f"stretch,stress_MPa\n{rows}", encoding="utf-8")
    options = ["--discrepancy", "none", "--noise-sd", 1e-3, "--prior", "C10=normal(0.04,0.03)", "--no-figures"]
    said = done("fit", "soft.csv", *options, "--out", "soft")
    return here / "soft", said.out


def test_small_stresses_in_mpa_are_shown_in_kpa_and_typed_in_mpa(cli, done, here, specimen, soft):
    options = ["--discrepancy", "none", "--noise-sd", 1, "--prior", "C10=normal(40,30)", "--no-figures"]
    said = done("fit", specimen, *options, "--out", "kpa")
    folder, printed = soft
    answer = [line for line in printed.splitlines() if " C10 " in line]
    assert answer == [line for line in said.out.splitlines() if " C10 " in line]
    assert " kPa" in answer[0]
    c10 = next(row for row in rows_of(folder / "parameters.csv") if row["parameter"] == "C10")
    assert (c10["unit"], c10["prior"]) == ("MPa", "normal(0.04, 0.03, low=0)")
    assert "Noise: sd 0.001 MPa." in cli("show", folder, "--details").out
    assert " kPa" in cli("compare", folder, "kpa").out.partition("over the fits")[2].splitlines()[0]
    scores = [rows_of(here / name / "scores.csv")[0] for name in ("a", "b") if cli(
        "predict", folder if name == "a" else "kpa", "--data", "soft.csv", "--out", name, "--no-figures"
    ).status == 0]  # fmt: skip
    assert float(scores[0]["crps [kPa]"]) == pytest.approx(float(scores[1]["crps [kPa]"]), rel=1e-6)


def test_the_data_of_a_run_are_read_back_with_their_unit(run, specimen):
    data, of_run = tq.read(specimen, unit="kPa"), tq.read(run / "data.csv")
    assert of_run.stress_unit == "kPa"
    assert of_run.stress == pytest.approx(data.stress, rel=1e-12)


def test_a_run_of_an_earlier_version_says_how_to_make_it_again(cli, refused, done, run):
    shown = cli("show", run)
    (run / "result.json").unlink()
    refused(["result.json is missing. If an earlier version made it, make it again, as the first line of"], "show", run)
    first = (run / "run.toml").read_text(encoding="utf-8").splitlines()[0]
    words = first.partition("tissuq ")[2].replace("run.toml", str(run / "run.toml")).replace("ANOTHER_FOLDER", "again")
    done(*words.split())
    assert cli("show", "again").out.split() == shown.out.replace(str(run), "again").split()
