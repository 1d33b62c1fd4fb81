"""Dataclasses, arrays, tables and plain values to one ``.npz`` file and back, without pickle.

The structure becomes JSON; every array is a member of its own. Only dataclasses of bladefem and
geometry are made again on reading, so that a file from elsewhere cannot run code.
"""

from __future__ import annotations

import dataclasses
import json
from importlib import import_module
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.lib.format import write_array

from ..util.message import Message

_HOMES = ("bladefem", "geometry")


def write_npz(
    path: str | Path,
    key: str,
    value: Any,
) -> None:
    """Write a value with its key; TypeError for what has no encoding."""
    tree, arrays = tree_of(value)
    members: dict[str, Any] = {f"a{i}": a for i, a in enumerate(arrays)}
    # as np.savez does, which on a full disk leaves an archive whose end complains once more
    with ZipFile(path, "w") as archive:
        for name, array in {"key": np.array(key), "tree": np.array(tree), **members}.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                write_array(file, np.asanyarray(array), allow_pickle=False)


def read_npz(path: str | Path, key: str) -> Any:
    """The value that was written with this key.

    Raises:
        ValueError: another key, or not a file of :func:`write_npz`.
        OSError: no such file.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            if str(file["key"]) != key:
                raise ValueError(f"{path}: made from other input")
            arrays = [file[f"a{i}"] for i in range(len(file.files) - 2)]
            return _decode(json.loads(str(file["tree"])), arrays)
    except (
        BadZipFile,
        EOFError,
        KeyError,
        IndexError,
        TypeError,
        AttributeError,
        ImportError,
        # of a zip file whose head asks for what Python's cannot do
        RuntimeError,
    ) as error:
        raise ValueError(f"{path}: not a stored stage ({error})") from error


def tree_of(value: Any) -> tuple[str, list[np.ndarray]]:
    """JSON text of the structure, and the arrays that it counts from 0."""
    arrays: list[np.ndarray] = []
    return json.dumps(_encode(value, arrays), sort_keys=True), arrays


def _encode(value: Any, arrays: list[np.ndarray]) -> Any:
    # a text with a level, which as a plain one would come back as information
    if isinstance(value, Message):
        return {"w": [str(value), value.level, value.advice, value.detail]}
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return {"f": float(value).hex()}
    if isinstance(value, complex):
        return {"c": [value.real.hex(), value.imag.hex()]}
    if isinstance(value, np.generic):
        return _encode(value.item(), arrays)
    if isinstance(value, np.ndarray):
        return _array(value, arrays)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            "d": _home(type(value)),
            "v": {
                f.name: _encode(getattr(value, f.name), arrays)
                for f in dataclasses.fields(value)
                if f.init
            },
        }
    # a scipy.sparse matrix, which comes back as csc
    if hasattr(value, "tocsc") and hasattr(value, "nnz"):
        csc = value.tocsc()
        return {
            "p": [
                list(csc.shape),
                *(_array(a, arrays) for a in (csc.data, csc.indices, csc.indptr)),
            ]
        }
    # a pandas table, without importing pandas where there is none
    if hasattr(value, "columns") and hasattr(value, "iloc"):
        return {"q": [[_encode(name, arrays), _column(value[name], arrays)] for name in value]}
    if isinstance(value, slice):
        return {"s": [value.start, value.stop, value.step]}
    if isinstance(value, dict):
        return {"m": [[_encode(k, arrays), _encode(v, arrays)] for k, v in value.items()]}
    if isinstance(value, (list, tuple)):
        return {"t" if isinstance(value, tuple) else "l": [_encode(v, arrays) for v in value]}
    raise TypeError(
        f"a {type(value).__name__} cannot be stored; expected dataclasses, arrays, tables "
        "and plain values"
    )


def _column(column: Any, arrays: list[np.ndarray]) -> Any:
    """A column of a table whose rows are numbered from 0: numbers as an array, words as a list."""
    if list(column.index) != list(range(len(column))):
        raise TypeError("a table whose rows are not numbered from 0 cannot be stored")
    if isinstance(column.dtype, np.dtype) and column.dtype != object:
        return _array(column.to_numpy(), arrays)
    return _encode(column.tolist(), arrays)


def _array(value: np.ndarray, arrays: list[np.ndarray]) -> Any:
    if value.dtype == object:
        raise TypeError("an array of objects cannot be stored")
    arrays.append(value)
    return {"a": len(arrays) - 1}


def _home(kind: type) -> str:
    if kind.__module__.partition(".")[0] not in _HOMES:
        raise TypeError(f"{kind.__module__}.{kind.__qualname__} cannot be stored")
    return f"{kind.__module__}:{kind.__qualname__}"


def _decode(tree: Any, arrays: list[np.ndarray]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "d" in tree:
        return _class(tree["d"])(**{name: _decode(v, arrays) for name, v in tree["v"].items()})
    ((mark, body),) = tree.items()
    return _DECODERS[mark](body, arrays)


_DECODERS = {
    "f": lambda body, _: float.fromhex(body),
    "c": lambda body, _: complex(float.fromhex(body[0]), float.fromhex(body[1])),
    "a": lambda body, arrays: arrays[body],
    "p": lambda body, arrays: _sparse(tuple(body[0]), *(arrays[part["a"]] for part in body[1:])),
    "q": lambda body, arrays: _table(body, arrays),
    "s": lambda body, _: slice(*body),
    "w": lambda body, _: Message(*body),
    "m": lambda body, arrays: {_decode(k, arrays): _decode(v, arrays) for k, v in body},
    "l": lambda body, arrays: [_decode(v, arrays) for v in body],
    "t": lambda body, arrays: tuple(_decode(v, arrays) for v in body),
}


def _table(body: list[Any], arrays: list[np.ndarray]) -> Any:
    import pandas as pd

    columns = {_decode(name, arrays): _decode(values, arrays) for name, values in body}
    # of a list without values pandas would make numbers
    return pd.DataFrame(
        {
            name: pd.Series(values, dtype=object if isinstance(values, list) else None)
            for name, values in columns.items()
        }
    )


def _sparse(
    shape: tuple[int, int],
    data: np.ndarray,
    indices: np.ndarray,
    indptr: np.ndarray,
) -> Any:
    from scipy.sparse import csc_matrix

    return csc_matrix((data, indices, indptr), shape=shape)


def _class(home: str) -> type:
    module, _, name = home.partition(":")
    if module.partition(".")[0] not in _HOMES:
        raise ValueError(f"{home} is not a class of bladefem")
    kind = getattr(import_module(module), name)
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        raise ValueError(f"{home} is not a dataclass")
    return kind
