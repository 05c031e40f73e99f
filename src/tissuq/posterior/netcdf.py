"""Labelled arrays as groups of a NetCDF file, which ArviZ and xarray open.

Not through xarray, whose import takes longer than a fit, nor h5netcdf, which takes longer than HDF5 itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from zlib import compress

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

COMPRESSED_SIZE, SAMPLE_SIZE, MAX_SHRUNK_SHARE = 1000, 4000, 0.75
"""Number of values in an array from which it is compressed, if so many of its values then shrink to such a share."""
COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
CHECKSUM = {"fletcher32": True}
"""Of every array, by which the HDF5 library refuses to read one that is damaged on a disk."""
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable. {:9d}"
"""Name of a scale that is a dimension without coordinates."""


class Group(NamedTuple):
    """What was read of a group of a file: arrays by name, and texts and numbers."""

    arrays: dict[str, NDArray[Any]]
    attrs: dict[str, Any]


@dataclass(frozen=True)
class LabelledGroup:
    """Arrays with names of their dimensions, and their coordinates.

    Attributes
    ----------
    arrays, coordinates : dict of str to tuple
        Dimensions, values and, where there are some, attributes; values alone for the coordinate of a dimension.
    attrs : dict of str to str or number
    """

    arrays: dict[str, Any] = field(default_factory=dict)
    coordinates: dict[str, Any] = field(default_factory=dict)
    attrs: dict[str, Any] = field(default_factory=dict)

    @property
    def as_read(self) -> Group:
        """What `read_groups` gives of it once it is written."""
        return Group({name: np.asarray(described[1]) for name, described in self.arrays.items()}, self.attrs)

    def to_dataset(self) -> xr.Dataset:
        """Return the same as a data set of xarray."""
        import xarray as xr

        return xr.Dataset(self.arrays, self.coordinates, self.attrs)

    def write(self, group: Any) -> None:
        """Write everything into a group of an open file of HDF5, as NetCDF does: dimensions are scales."""
        import h5py

        _write_attributes(group, self.attrs)
        scattered: dict[str, set[str]] = {}
        for name, described in (self.coordinates | self.arrays).items():
            along, values, *attributes = described if isinstance(described, tuple) else (name, described)
            dims, array = (along,) if isinstance(along, str) else tuple(along), np.asarray(values)
            array = array.astype(h5py.string_dtype()) if array.dtype.kind == "U" else array
            packed = COMPRESSION if array.size > COMPRESSED_SIZE and _shrinks(array) else {}
            checked = CHECKSUM if array.size and array.ndim and array.dtype.kind in "fiub" else {}
            variable = group.create_dataset(name, data=array, **packed, **checked)
            _write_attributes(variable, *attributes)
            if dims == (name,):
                variable.make_scale(name)
                continue
            for axis, (dim, size) in enumerate(zip(dims, array.shape, strict=True)):
                if dim not in group:
                    group.create_dataset(dim, (size,), ">f4").make_scale(NO_VARIABLE.format(size))
                variable.dims[axis].attach_scale(group[dim])
            if name in self.coordinates:
                scattered[name] = set(dims)
            else:
                beside = [key for key, labels in scattered.items() if labels <= set(dims)]
                _write_attributes(variable, {"coordinates": " ".join(beside)} if beside else {})


def _shrinks(array: NDArray[Any]) -> bool:
    """Return whether compression is worth its time, which is long for random digits."""
    if array.dtype.kind not in "fiu":
        return True
    sample = array.ravel()[:SAMPLE_SIZE].tobytes()
    return len(compress(sample, 1)) < MAX_SHRUNK_SHARE * len(sample)


def _write_attributes(file: Any, attributes: Mapping[str, str | float] | None = None) -> None:
    for name, value in (attributes or {}).items():
        file.attrs[name] = value if isinstance(value, str) else np.atleast_1d(value)


def digest(groups: Mapping[str, Group]) -> str:
    """Return a digest of all arrays of numbers and attributes of groups, the same for every type of the numbers."""
    found = sha256()
    for name, group in sorted(groups.items()):
        attributes = {
            f"@{key}": value if isinstance(value, str) else np.squeeze(value) for key, value in group.attrs.items()
        }
        for key, value in sorted((group.arrays | attributes).items()):
            numbers = np.zeros(0) if isinstance(value, str) else np.asarray(value, dtype=np.float64)
            found.update(repr((name, key, value if isinstance(value, str) else numbers.shape)).encode())
            found.update(numbers.tobytes())
    return found.hexdigest()


def save_groups(groups: Mapping[str, LabelledGroup], path: Path) -> None:
    """Write groups by name, the root's ``"/"``, as one NetCDF file."""
    import h5py

    content = BytesIO()  # the HDF5 library must not meet a full disk itself: it fails where no one can catch it
    with h5py.File(content, "w", track_order=True) as file:
        for name, group in groups.items():
            group.write(file if name == "/" else file.create_group(name, track_order=True))
    path.write_bytes(content.getvalue())


def tree_of(groups: Mapping[str, LabelledGroup]) -> xr.DataTree:
    """Return groups by name, the root's ``"/"``, as a tree of xarray."""
    import xarray as xr

    return xr.DataTree.from_dict({name: group.to_dataset() for name, group in groups.items()})


def read_groups(path: Path, root: str) -> dict[str, Group]:
    """Read a group of a file and all within it, by name; none where there is no such group; without coordinates."""
    with opened(path) as file:
        return dict(_nested(file[root], root, root)) if root in file else {}


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open a file of HDF5 to read; an error where its structure is damaged, on which single reads can wait for ever."""
    import h5py

    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: None)
        yield file


def _nested(group: Any, name: str, root: str) -> Iterator[tuple[str, Group]]:
    """Yield a group of a file and all within it, by name."""
    import h5py

    contents = dict(group.items())
    variables = {key: item for key, item in contents.items() if isinstance(item, h5py.Dataset)}
    arrays = {key: variable[()] for key, variable in variables.items() if not variable.is_scale}
    attrs = {key: value if isinstance(value, str) else np.squeeze(value)[()] for key, value in group.attrs.items()}
    yield name.removeprefix(f"{root}/"), Group(arrays, attrs)
    for key, item in contents.items():
        if key not in variables:
            yield from _nested(item, f"{name}/{key}", root)
