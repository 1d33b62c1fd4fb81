"""The run folder: stages that are kept and found again, one netCDF file of results, CSV tables.

A stage is stored under its name with the hash of what it depends on; a finished stage survives an
interruption, and a changed friction coefficient does not redo the mesh. Everything is written to a
temporary name and renamed, so that a file is there whole or not at all.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..errors import InputError, UnwritableError
from ..util.communicator import Communicator
from ..util.message import Message
from .array_codec import read_npz, tree_of, write_npz

if TYPE_CHECKING:
    import xarray as xr

# Raised when the meaning or the layout of stored stages changes: older files are then computed
# again.
STAGE_FORMAT = 10
Result = TypeVar("Result")


def open_folder(path: str | Path) -> Path:
    """The run folder, made if needed and shown to be writable.

    Raises:
        InputError: it cannot be made or written.
    """
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(f"folder {path}: cannot be written ({error.strerror or error})") from None
    return path


@contextmanager
def write_atomically(path: str | Path) -> Iterator[Path]:
    """A temporary name in the folder of ``path``; renamed to it when the block ends well, removed
    when it does not.

    Raises:
        UnwritableError: the disk is full or the folder cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise UnwritableError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def key_of(*parts: Any) -> str:
    """Hash of numbers, texts, arrays and dataclasses: equal content, equal key."""
    digest = hashlib.sha256(f"{STAGE_FORMAT}".encode())
    _feed(digest, parts)
    return digest.hexdigest()[:20]


def code_of(*packages: str) -> str:
    """Hash of the sources of packages such as "geometry" or "bladefem.fem", so that a new program
    redoes its stages.
    """
    digest = hashlib.sha256()
    for package in packages:
        found = find_spec(package)
        if found is None or not found.submodule_search_locations:
            raise ModuleNotFoundError(f"{package}: no such package of sources")
        for file in sorted(Path(found.submodule_search_locations[0]).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:20]


def cached_stage(
    folder: str | Path | None,
    name: str,
    key: str,
    compute: Callable[[], Result],
    comm: Communicator | None = None,
) -> tuple[Result, float | None]:
    """The result of a stage: found in the folder when it was made from the same things, else
    computed and kept.

    Args:
        folder: run folder; ``None`` to keep nothing.
        name: file name of the stage, without ending.
        key: :func:`key_of` everything that the result depends on.
        compute: makes the result, of dataclasses, arrays, dicts, lists and plain values; collective
            on ``comm``.
        comm: communicator; rank 0 reads and writes for all, each rank gets the same.

    Returns:
        the result, and where it was found the seconds that it once took.
    """
    if folder is None:
        return compute(), None
    path = Path(folder) / "stages" / f"{name}.npz"
    found = on_root(comm, lambda: _find(path, key))
    if found is not None:
        return found
    start = time.perf_counter()
    result = compute()
    seconds = time.perf_counter() - start
    on_root(comm, lambda: _keep(path, key, (result, seconds)))
    return result, None


def write_results(
    path: str | Path,
    groups: Mapping[str, Any],
    scene_text: str = "",
) -> Path:
    """One netCDF-4 file of labelled arrays.

    Args:
        path: file, ending in ``.nc``.
        groups: group name to xarray Dataset ("/" for the root); every variable says its unit in
            ``attrs["units"]``.
        scene_text: the resolved scene, kept as an attribute with the versions of what made the
            file.
    """
    import xarray as xr

    bind_h5py()
    path = Path(path)
    root = groups.get("/", xr.Dataset()).assign_attrs(attributes(scene_text))
    with write_atomically(path) as temporary:
        _real(root).to_netcdf(temporary, mode="w", engine="h5netcdf")
        for name, dataset in groups.items():
            if name != "/":
                _real(dataset).to_netcdf(temporary, mode="a", group=name, engine="h5netcdf")
    return path


def read_results(path: str | Path, group: str = "/") -> xr.Dataset:
    """One group, complex variables put together again, wholly in memory.

    Raises:
        InputError: no such file or group.
    """
    import xarray as xr

    bind_h5py()
    try:
        with xr.open_dataset(path, group=group, engine="h5netcdf") as dataset:
            return _complex(dataset.load())
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: group '{group}' cannot be read ({error})") from None


def write_table(
    path: str | Path,
    columns: Mapping[str, Any],
    units: Mapping[str, str] | None = None,
) -> Path:
    """A CSV table with units in its head, "amplitude [m]".

    Args:
        columns: name to values, all of one length; a pandas DataFrame will do.
        units: name to unit; columns without one are plain numbers or words.
    """
    import pandas as pd

    table = pd.DataFrame(columns)
    units = units or {}
    unknown = set(units) - set(table.columns)
    if unknown:
        raise KeyError(f"units for columns that are not there: {sorted(unknown)}")
    table = table.rename(columns={c: f"{c} [{units[c]}]" for c in table.columns if units.get(c)})
    with write_atomically(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.9g")
    return Path(path)


def write_text(path: str | Path, text: str) -> Path:
    """A text file, whole or not at all; paths in it that the locale has no letters for as they are
    on disk.
    """
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="surrogateescape")
    return Path(path)


def library_versions() -> dict[str, str]:
    """Versions of what results depend on; "absent" for what is not installed."""
    names = {
        "bladefem": "bladefem",
        "dolfinx": "fenics-dolfinx",
        "petsc4py": "petsc4py",
        "slepc4py": "slepc4py",
        "gmsh": "gmsh",
        "numpy": "numpy",
        "scipy": "scipy",
        "numba": "numba",
    }
    return {name: _version(distribution) for name, distribution in names.items()}


def attributes(scene_text: str = "") -> dict[str, str]:
    """What a result file says about its origin."""
    made = "; ".join(f"{name} {version}" for name, version in library_versions().items())
    return {
        "title": "bladefem run",
        "scene": scene_text,
        "versions": made,
        "Conventions": "units in SI",
    }


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return "absent"


def found_remark(name: str, seconds: float) -> str:
    """A remark that a stage was found, for the messages of a run."""
    return Message(f"{name}: found in the folder, where it was made in {seconds:.1f} s", "timing")


def _find(path: Path, key: str) -> tuple[Any, float] | None:
    """The stored result and its seconds, or None when there is none, it is older, or it is
    damaged.
    """
    try:
        result, seconds = read_npz(path, key)
    except (OSError, ValueError, TypeError):
        return None
    return result, seconds


def _keep(
    path: Path,
    key: str,
    made: tuple[Any, float],
) -> None:
    open_folder(path.parent)
    with write_atomically(path) as temporary:
        write_npz(temporary, key, made)


def on_root(comm: Communicator | None, action: Callable[[], Result]) -> Result:
    """The value of ``action`` on rank 0, or its error, on every rank."""
    if comm is None or comm.size == 1:
        return action()
    value: Result | None = None
    error: Exception | None = None
    if comm.rank == 0:
        try:
            value = action()
        except Exception as problem:
            # whatever it is, the other ranks must not wait for ever
            error = problem
    shared, failure = comm.bcast((value, error))
    if failure is not None:
        raise failure
    return shared


def _feed(digest: Any, part: Any) -> None:
    tree, arrays = tree_of(part)
    digest.update(tree.encode())
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())


def bind_h5py() -> None:
    """Import h5py so that it keeps to its own HDF5.

    dolfinx loads the system's HDF5; an h5py wheel that is imported later would resolve against it
    and fail ("Not a datatype") unless it is bound deeply.
    """
    flags = sys.getdlopenflags()
    sys.setdlopenflags(os.RTLD_NOW | getattr(os, "RTLD_DEEPBIND", 0))
    try:
        import h5py  # noqa: F401
    finally:
        sys.setdlopenflags(flags)


def _real(dataset: xr.Dataset) -> xr.Dataset:
    """netCDF has no complex numbers: "x" becomes "x_re" and "x_im"."""
    for name in [n for n, v in dataset.data_vars.items() if np.iscomplexobj(v)]:
        variable = dataset[name]
        parts = {f"{name}_re": variable.real, f"{name}_im": variable.imag}
        dataset = dataset.drop_vars(name).assign(
            {n: v.assign_attrs(variable.attrs) for n, v in parts.items()}
        )
    return dataset


def _complex(dataset: xr.Dataset) -> xr.Dataset:
    for name in [
        n[:-3] for n in dataset.data_vars if n.endswith("_re") and f"{n[:-3]}_im" in dataset
    ]:
        whole = (dataset[f"{name}_re"] + 1j * dataset[f"{name}_im"]).assign_attrs(
            dataset[f"{name}_re"].attrs
        )
        dataset = dataset.drop_vars([f"{name}_re", f"{name}_im"]).assign({name: whole})
    return dataset
