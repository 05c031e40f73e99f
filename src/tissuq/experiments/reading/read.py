"""A file or a table as one experiment, as people read it in Python: with warnings of what is doubtful in the test."""

from __future__ import annotations

import warnings
from typing import Any, Unpack

from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.experiment_file import read_file
from tissuq.experiments.reading.findings import experiment_of
from tissuq.experiments.reading.options import PythonOptions
from tissuq.experiments.reading.python_form import refusals_in_python
from tissuq.result_warning import Severity


def read(path: Any, **options: Unpack[PythonOptions]) -> Experiment:
    """Read stretches and stresses from a file (CSV, TSV, columns of numbers, an Excel workbook) or a table in memory.

    Separators, decimal points or commas, encodings, lines above the table, a row of column names, a
    row of units, and columns and dimensions in English or German are recognised. Nothing is guessed where a wrong
    guess would change the numbers.

    Parameters
    ----------
    path : str or path, or table
        The file, or a table in memory: a DataFrame of pandas or polars, a Dataset of xarray, a mapping from names to
        arrays or quantities of pint. Units are those in the names of columns, of quantities, and of the attributes
        ``units`` of xarray.
    stretch, strain, displacement, shear, twist, rate, sliding, stress, torque, force : str or int, optional
        Entries of ``columns``: the name of a column, or its number from 1; those of a second axis end in 2.
    pressure, outer_diameter, inner_diameter, total_force : str or int, optional
        Likewise, of a tube; its axial force is ``force``, or ``total_force`` with that of the pressure on its ends.
    axial_stretch : float, optional
        Of a tube that was stretched along its axis: the length at which it is held over the undeformed one. Without it
        the file's column of that name, the one in ``columns`` under ``axial_stretch``, also of lengths, or what a line
        above the table states.
    length, area, width, thickness, diameter : str, optional
        Entries of ``dimensions``, such as ``"10 mm"``, or quantities of pint.
    unit : str, optional
        In short for ``stress_unit``.
    mode : str or LoadingMode, optional
        How the specimen was loaded. Without it as a comment in the file (``# mode: planar``), its name or its columns
        say: both axes of a biaxial machine, or an amount of shear; else uniaxial.
    columns : mapping, optional
        From ``stretch``, ``strain``, ``displacement``, ``length`` (the current one, or the height), ``shear`` (the
        amount of shear), ``sliding`` (the displacement of one sheared plane, over the height ``length``), ``twist``
        (of a disc), or ``outer_diameter`` or ``inner_diameter`` (of a tube), and ``stress``, ``force``, ``torque`` or
        ``pressure`` (in a tube), to the name of a column or its number from 1. Columns with usual names (with a unit or
        not) need none. The second axis or stress of a loading mode that has two is ``stretch2`` ... ``force2``; columns
        with x and y in their names need none in the mode ``biaxial``.
    stress_unit : str, optional
        Unit of the stresses; without it the file's own, and MPa when the file states none. For a file of forces,
        the unit in which people want to read the stresses, kPa unless given.
    stress_type : str, optional
        ``engineering`` (force over undeformed area); ``cauchy``, which is divided by the stretch (a shear stress is the
        same in both); ``second-piola-kirchhoff``, which is multiplied by the deformation gradient; or ``torsion``, the
        stress 2 T / (pi R^3) that rheometers state for the rim of a disc. Without it what the column's name says, and
        engineering where that says nothing.
    strain_type : str, optional
        ``engineering`` (stretch - 1, or the amount of shear), ``true`` (logarithmic), ``green``, ``almansi``, or
        ``angle`` of shear; otherwise as `stress_type`.
    strain_unit : str, optional
        ``%`` or ``1``, for a column of strains; without it the file's own, and 1 when it states none. ``deg`` or
        ``rad`` for angles of shear.
    force_unit, displacement_unit : str, optional
        Such as ``mN`` and ``um``, for columns of which the file states no unit.
    zero : str, optional
        From which value displacements are counted, such as ``35.2 mm``, or ``first`` for that of the first row: there
        the specimen has its undeformed length. Without it from 0, or from the first row where
        they begin away from 0 with little load.
    mean_of : int, optional
        Of how many specimens the stresses are means; without it the file's column ``n``. Standard errors of the
        experiment come from a column of them (``sem``), or of standard deviations (``sd``) of so many specimens.
    dimensions : mapping, optional
        Of the undeformed specimen, with units: ``length``; ``area``, or ``width`` and ``thickness``, or ``diameter``.
        Without it those that the file states: in the lines above the table, in columns that hold one number, or in a
        table of specimens above it or in another sheet of the workbook. Only displacements and forces need
        them, and a tube its outer ``diameter`` and the ``thickness`` of its wall. In the mode ``biaxial`` length and
        width are the sizes along the first and the second axis, and the width of one axis is the length of the other.
    only : mapping, optional
        From the name of a column to what must stand in it, such as ``{"Specimen": "S1"}``: the only rows to read. A
        table of several specimens is refused without it.
    compression_positive : bool, optional
        Whether the file counts compression as positive: flips stresses at stretches below 1, and strains and
        displacements that are positive, too. Without it compression is negative, and asked about where a name says
        compression, or the specimen is broader than long, and the numbers are positive.
    turn : str, optional
        ``load``, ``deformation`` or ``both``: which signs are changed, as of a load cell that counts tension as
        negative. For all loading modes.
    load_zero : str, optional
        The reading of the load cell without load, which is taken off: a force or stress with its unit, or ``first`` for
        that of the first row.
    cycle : str or int, optional
        ``first``, ``last`` or the number (from 1) of the only cycle to use; all unless given.
    branch : str, optional
        ``loading`` or ``unloading``: the only branch to use.
    compliance : str, optional
        Of the machine, a length over a force such as ``0.5 um/N``: displacements are less by what it gives under load.
    leave_out : str, optional
        Lines of the file whose rows to leave out, such as ``31,45:50``.
    preload : str, optional
        Force or stress with its unit (``0.05 N``, ``1 kPa``) at which the specimen counts as taut: stretches are
        counted from there, and rows that carry less are dropped. Or ``auto``: they are counted from where load begins,
        as far as slack shows, with an uncertainty that becomes one of the ``least_errors``.
    stretch_range : pair of float, optional
        Lowest and highest stretch, or amount of shear, of the rows to use, as counted from the preload.
    until_peak : bool
        Leave out the rows after the largest stress of those that are left: rupture, relaxation, unloading.
    relaxed : bool
        Use the last row of every rest only: of a test in steps, after each of which the stress relaxes.
    incompressible : bool
        Take the volume of a uniaxial test as constant, though a column of lateral strains says that it changes.
    every : int
        Use only every second (2), third (3) ... of these rows.
    axis : str, optional
        ``x`` or ``y``: the only one whose columns to read from the file of a biaxial machine.
    sheet : str or int, optional
        Name or number (from 1) of the sheet of a workbook.
    table : int, optional
        Which of several tables of a text or sheet, from 1.
    name : str, optional
        Name of the experiment; the name of the file without its ending when not given.
    skip_rows : int
        Lines at the top of the file to pass over unseen.

    Returns
    -------
    Experiment
        Stretches (dimensionless) and engineering stresses (MPa) in the order of the file, with a column for each
        axis where the loading mode has two; its ``source``
        tells the file, columns, units and every step. :func:`tissuq.inspect` shows them.

    Warns
    -----
    UserWarning
        Of a unit or a zero of displacements that was assumed, of dimensions that the file states otherwise, of rows
        and columns that cannot be used and are left out, and of what no elastic material does in a test, such as cycles
        that differ, a drift of the load cell, relaxation or a rupture.

    Raises
    ------
    InputError
        When the file, a cell or an option cannot be used, naming the line (of a table in memory its row, counted from
        0) and the column.

    Examples
    --------
    >>> import pandas as pd
    >>> import tissuq as tq
    >>> data = tq.read(tq.datasets.path("rubber-treloar-uniaxial"))
    >>> data.stress_unit, len(data)
    ('MPa', 21)
    >>> frame = pd.DataFrame({"lambda": [1.0, 1.1, 1.2], "P [kPa]": [0.0, 2.5, 5.5], "T [kPa]": [0.0, 2.75, 6.6]})
    >>> tq.read(frame, stress="P [kPa]").stress.tolist()
    [0.0, 0.0025, 0.0055]
    """
    with refusals_in_python(path):
        reading = read_file(path, **options)
    experiment = experiment_of(reading)
    for warning in experiment.curves[0].warnings:
        if warning.severity is not Severity.NOTE:
            warnings.warn(warning, stacklevel=2)
    return experiment


read_experiment = read
"""The earlier name of `read`."""
