"""``tissuq structure``: its folder, how it goes on, and what it refuses."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest

from .conftest import fitted_in, rows_of

pytest.importorskip("felupe", reason="FElupe is not installed")

SMALL = ["--case", "bar", "--draws", 3, "--steps", 2, "--size", "fineness=0.5", "--workers", 1]


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """The run folder of a fit."""
    folder = tmp_path_factory.mktemp("fitted")
    fitted_in(folder, "--no-figures", "--out", "run")
    return folder / "run"


@pytest.fixture
def run(fitted, here, specimen):
    """A copy of it in the current folder."""
    shutil.copytree(fitted, here / "run")


@pytest.mark.finite_elements
def test_it_leaves_tables_curves_fields_and_a_report(cli, here, run):
    import xarray as xr

    said = cli("structure", "run", *SMALL)
    folder = here / "runs" / "run-bar"
    assert said.status == 0, said.err
    assert "Case 'bar' with 3 draws" in said.out
    assert "VTU" not in said.err
    assert str(folder.relative_to(here) / "report.html") in said.out
    rows = rows_of(folder / "forces.csv")
    assert [float(row["elongation_mm"]) for row in rows] == [0.5, 1.0]
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["complete_draws"] == 3
    assert summary["last_step"]["mean"] == pytest.approx(float(rows[-1]["mean"]))
    free = {name: 1e3 * float(rows[-1][f"mesh_free_{name}"]) for name in ("mean", "low", "high")}  # mN
    (number, *_) = json.loads((folder / "result.json").read_text(encoding="utf-8"))["numbers"]
    assert (number["value"], number["low"], number["high"]) == pytest.approx(tuple(free.values()), rel=1e-6)
    assert free["mean"] != pytest.approx(1e3 * float(rows[-1]["mean"]), rel=1e-6)
    with xr.open_dataset(folder / "curves.nc") as curves:
        assert curves["force_complete"].shape == (3, 2)
        assert curves["force_without"].mean("draw_without").values[-1] == pytest.approx(float(rows[-1]["without_mean"]))
    for name in ("fields.vtu", "middle_draw.pvd", "steps/step_02.vtu", "figures/forces.svg", "figures/shares.png"):
        assert (folder / name).stat().st_size > 200, name
    of_fit = json.loads((here / "run" / "result.json").read_text(encoding="utf-8"))["uses"][-1]
    (use,) = json.loads((folder / "result.json").read_text(encoding="utf-8"))["uses"]
    assert use == of_fit | {"purpose": "use of the fit in finite elements"}
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "too few for a 95\u00a0% band" in page
    assert "it takes more draws to tell them apart" in page
    assert "is taken out first" not in page
    assert page.count("data:image/svg+xml") == 4


@pytest.mark.finite_elements
def test_a_plate_with_a_hole_has_the_same_files_of_a_solid(done, here, run):
    meshio = pytest.importorskip("meshio")
    sizes = ["--size", "fineness=0.25", "--size", "elongation=1"]
    done("structure", "run", "--case", "plate", "--draws", 2, "--steps", 1, *sizes, "--workers", 1, "--out", "plate")
    mesh = meshio.read(here / "plate" / "fields.vtu")
    assert mesh.cells_dict["hexahedron"].shape == (12, 8)
    pulled = mesh.points[:, 1] == mesh.points[:, 1].max()
    np.testing.assert_allclose(mesh.point_data["mean displacement"][pulled, 1], 0.5)
    assert (here / "plate" / "figures" / "fields.png").stat().st_size > 1000
    assert "12 hexahedra with one pressure" in (here / "plate" / "report.html").read_text(encoding="utf-8")


@pytest.mark.finite_elements
def test_a_mesh_of_your_own_is_copied_and_its_recipe_goes_on(cli, done, here, run):
    """A block that a plane compresses, uniformly: its force is known from the material's own curve."""
    fem, meshio = pytest.importorskip("felupe"), pytest.importorskip("meshio")
    block = fem.Rectangle(b=(2.0, 3.0), n=3)
    meshio.Mesh(np.pad(block.points, ((0, 0), (0, 1))), [("quad", block.cells)]).write(here / "block.vtu")
    mesh = ["--mesh", "block.vtu", "--hold", "ymin=y", "--hold", "xmin=x", "--shape", "axisymmetric"]
    few = ["--draws", 3, "--steps", 1, "--workers", 1]
    done("structure", "run", *mesh, "--move", "ymax=y:-0.3", *few)
    folder = here / "runs" / "run-block"
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "4 axisymmetric quadrilaterals with one pressure" in page
    assert "not known: compute it with a finer mesh" in page
    points = meshio.read(folder / "fields.vtu")
    np.testing.assert_allclose(points.points[:, :2], block.points)
    np.testing.assert_allclose(points.point_data["mean displacement"][block.points[:, 1] == 3.0, 1], -0.3)
    recipe = (folder / "run.toml").read_text(encoding="utf-8")
    assert "case" not in recipe
    (folder / "earlier.toml").write_text(f'case = "indentation"\n{recipe}', encoding="utf-8")  # of an earlier version
    for number, name in enumerate(("earlier.toml", "run.toml")):
        out = ["--out", ("early", "again")[number], "--workers", 1]
        done("structure", "--config", folder / name, "--no-figures", *out)
    tables = [(path / "forces.csv").read_text(encoding="utf-8") for path in (folder, here / "again")]
    assert tables[0] == tables[1]
    meshio.Mesh(np.pad(1.1 * block.points, ((0, 0), (0, 1))), [("quad", block.cells)]).write(here / "block.vtu")
    said = cli("structure", "run", *mesh, "--move", "ymax=y:-0.3", *few)
    assert (said.status, "holds a simulation of another mesh" in said.err) == (2, True)


@pytest.mark.finite_elements
def test_a_finer_mesh_of_your_own_gives_the_force_for_cells_without_size(cli, done, here, run):
    """A block whose faces are held across as it is pressed, singular at its edge, against cells of an eighth."""
    fem, meshio = pytest.importorskip("felupe"), pytest.importorskip("meshio")
    for times in (1, 2, 8):
        block = fem.Rectangle(b=(2.0, 2.0), n=3 * times + 1)
        mesh = meshio.Mesh(np.pad(block.points, ((0, 0), (0, 1))), [("quad", block.cells)])
        mesh.write(here / f"block{times}.vtu")
    options = ["--hold", "ymin=xy", "--hold", "xmin=x", "--hold", "ymax=x", "--shape", "axisymmetric",
               "--move", "ymax=y:-0.2", "--draws", 3, "--steps", 1, "--workers", 1, "--no-figures"]  # fmt: skip
    last = {}
    for times, more in ((1, []), (1, ["--finer-mesh", "block2.vtu"]), (8, [])):
        done("structure", "run", "--mesh", f"block{times}.vtu", *options, *more, "--out", f"b{times}")
        last[times] = rows_of(here / f"b{times}" / "forces.csv")[-1]
    coarse, corrected, wanted = (
        float(row[name]) for row, name in ((last[1], "mean"), (last[1], "mesh_free_mean"), (last[8], "mean"))
    )
    assert abs(corrected / wanted - 1) < 0.5 * abs(coarse / wanted - 1)
    page = (here / "b1" / "report.html").read_text(encoding="utf-8")
    assert "On a mesh of twice the fineness the force of one draw" in page
    assert 'finer_mesh = "finer-mesh.vtu"' in (here / "b1" / "run.toml").read_text(encoding="utf-8")
    done("structure", "--config", "b1/run.toml", "--no-figures", "--out", "again", "--workers", 1)
    assert (here / "again" / "forces.csv").read_bytes() == (here / "b1" / "forces.csv").read_bytes()
    said = cli("structure", "run", "--mesh", "block2.vtu", *options, "--finer-mesh", "block1.vtu", "--out", "no")
    assert (said.status, "finer mesh has 9 quadrilaterals, and the mesh 36" in said.err) == (2, True)
    assert not (here / "no").exists()


@pytest.mark.finite_elements
def test_a_pressure_gives_a_displacement_in_every_file(done, here, run):
    import xarray as xr

    fem, meshio = pytest.importorskip("felupe"), pytest.importorskip("meshio")
    ring = fem.Rectangle(a=(1.0, 0.0), b=(1.5, 0.1), n=(4, 2))
    meshio.Mesh(np.pad(ring.points, ((0, 0), (0, 1))), [("quad", ring.cells)]).write(here / "tube.vtu")
    said = done(
        "structure", "run", "--mesh", "tube.vtu", "--shape", "axisymmetric", "--hold", "ymin=y", "--hold", "ymax=y",
        "--inflate", "xmin=0.05", "--watch", "xmax=x", "--draws", 3, "--steps", 2, "--workers", 1, "--out", "tube",
    )  # fmt: skip
    assert "displacement at pressure 0.05 kPa" in said.out
    rows = rows_of(here / "tube" / "displacements.csv")
    assert [float(row["pressure_kPa"]) for row in rows] == [0.025, 0.05]
    with xr.open_dataset(here / "tube" / "curves.nc") as curves:
        assert curves["displacement_complete"].attrs["units"] == "mm"
        assert curves["displacement_complete"].mean("draw").values[-1] == pytest.approx(float(rows[-1]["mean"]))
    page = (here / "tube" / "report.html").read_text(encoding="utf-8")
    assert "From the posterior to a displacement" in page
    assert "force" not in page.split("How to repeat")[0].split("<body")[1].lower().replace("enforce", "")


@pytest.mark.finite_elements
def test_few_full_runs_leave_curves_of_all_draws_and_say_the_error_of_the_others(done, here, run):
    import xarray as xr

    done("structure", "run", *SMALL, "--draws", 9, "--full-runs", 4, "--no-figures", "--out", "few")
    with xr.open_dataset(here / "few" / "curves.nc") as curves:
        assert np.isfinite(curves["force_complete"].values).all()
        assert curves["force_complete"].shape == curves["energy_beyond"].shape == (9, 2)
        assert np.isfinite(curves["energy_beyond"].values[:, -1]).sum() == 4
    error = json.loads((here / "few" / "summary.json").read_text(encoding="utf-8"))["first_order_error"]["complete"]
    assert 0 < error["force"] < 0.05
    assert 0 < error["sd"] < 0.5
    page = re.sub("</?span[^>]*>", "", (here / "few" / "report.html").read_text(encoding="utf-8"))
    assert "4 draws were computed in full" in page
    assert "4 of 9 draws computed in full, the others to first order" in page
    assert "Corrected for the size of the cells, from a mesh of twice the fineness" in page
    force, mean, sd = (f"{100 * error[name]:.2g}\u00a0%" for name in ("force", "mean", "sd"))
    assert f"the error of such a force is {force} at the last step" in page
    assert f"that of the mean of all draws {mean}, and that of their sd {sd}." in page


@pytest.mark.finite_elements
def test_the_same_command_goes_on_and_the_recipe_repeats_it(done, here, run):
    done("structure", "run", *SMALL, "--no-figures", "--out", "one")
    results = (here / "one" / "tasks.jsonl").read_text(encoding="utf-8").splitlines()
    (here / "one" / "tasks.jsonl").write_text("\n".join(results[:2]) + "\n" + results[2][:50], encoding="utf-8")
    done("structure", "run", *SMALL, "--no-figures", "--out", "one")
    done("structure", "--config", "one/run.toml", "--no-figures", "--out", "two", "--workers", 1)
    first, again = ((here / name / "forces.csv").read_text(encoding="utf-8") for name in ("one", "two"))
    assert first == again
    kept = (here / "one" / "tasks.jsonl").read_text(encoding="utf-8").splitlines()
    assert kept[:2] == results[:2]


@pytest.mark.finite_elements
def test_a_folder_of_something_else_is_refused(cli, done, here, run):
    done("structure", "run", *SMALL, "--no-figures", "--out", "one")
    said = cli("structure", "run", *SMALL, "--seed", 3, "--out", "one")
    assert (said.status, "other settings" in said.err) == (2, True)
    done("fit", "specimen.csv", "--noise-sd", 2, "--no-figures", "--out", "another")
    said = cli("structure", "another", *SMALL, "--out", "one")
    assert (said.status, "another run" in said.err) == (2, True)
    said = cli("structure", "run", *SMALL, "--out", "run")
    assert said.status == 2
    assert not (here / "run" / "tasks.jsonl").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["give the RUN folder of a fit"]),
        (
            ["run", "--config", "run.toml"],
            ["'run.toml' is of a simulation", "leave out --config, or the RUN folder of a fit (run)."],
        ),
        (["nowhere"], ["no run folder 'nowhere'"]),
        (["run", "--case", "beam"], ["no case named 'beam'", "bar, indentation"]),
        (["run", "--size", "width=3"], ["no size 'width'", "punch_radius=0.75"]),
        (["run", "--size", "depth"], ["'depth' is not a size", "NAME=VALUE"]),
        (["run", "--size", "depth=deep"], ["depth must be a number", "deep"]),
        (["run", "--size", "depth=7"], ["must be less than the height"]),
        (["run", "--size", "depth=0.1", "--size", "depth=0.2"], ["given twice for 'depth'"]),
        (["run", "--hold", "ymin=xyz"], ["give the mesh of the body, too: --mesh FILE"]),
        (["run", "--mesh", "none.msh", "--move", "ymax=y:1"], ["'none.msh' cannot be read"]),
        (
            ["run", "--mesh", "none.msh", "--move", "ymax:1"],
            ["'ymax:1' is not what --move needs; write SET=AXIS"],
        ),
        (["run", "--mesh", "none.msh", "--inflate", "ymax=2"], ["--inflate inner=2 --watch outer=x"]),
        (["run", "--case", "inflated"], ["give the mesh of the body, too"]),
        (["run", "--mesh", "none.msh"], ["needs one of --move ymax=y:-0.4"]),
        (["run", "--mesh", "none.msh", "--case", "bar", "--move", "ymax=y:1"], ["has no --case"]),
        (
            ["run", "--mesh", "none.msh", "--move", "ymax=y:1", "--tip-radius", "2"],
            ["--tip-radius goes with --press", "not --move"],
        ),
        (["run", "--finer-mesh", "fine.msh"], ["--mesh FILE", "--size NAME=VALUE"]),
        (["run", "--case", "sphere", "--tip-radius", "2"], ["--mesh FILE", "--size NAME=VALUE"]),
        (["run", "--case", "bar", "--parts", "2"], ["--mesh FILE", "--size NAME=VALUE"]),
        (["run", "--draws", "1"], ["draws", "greater than or equal to 2"]),
        (["run", "--discrepancy", "gp"], ["no discrepancy 'gp'", "auto"]),
    ],
)
def test_what_cannot_be_used_gets_one_message_and_leaves_nothing(refused, run, arguments, words):
    refused(words, "structure", *arguments, "--out", "out")


def test_a_bulk_modulus_of_no_incompressible_material_is_refused_before_anything_is_read(refused, here):
    refused(
        ["(--bulk-ratio): a bulk modulus of 0.01 initial shear moduli gives a Poisson's ratio that is not"],
        "structure",
        "no-run",
        "--bulk-ratio",
        0.01,
    )


def test_a_discrepancy_that_is_no_energy_is_refused_before_anything_is_written(refused, done, here, specimen):
    done("fit", specimen, "--noise-sd", 1, "--discrepancy", "constant", "--no-figures", "--out", "run")
    refused(["no material"], "structure", "run", *SMALL, "--out", "out")
    assert not (here / "out").exists()


def test_without_felupe_a_message_says_what_to_install(refused, here, run, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "felupe", None)
    refused(["its extra 'fe'"], "structure", "run", *SMALL, "--out", "out")
    assert not (here / "out").exists()
