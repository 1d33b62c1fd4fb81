"""Reduced matrices of other codes: Nastran DMIG entries by a small reader, Ansys by its own
library.
"""

from __future__ import annotations

import re
from cmath import rect
from collections.abc import Iterator
from math import radians
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError

# form of a DMIG matrix that is given whole, and of one of which one triangle is
SQUARE_FORM = 1
SYMMETRIC_FORM = 6
# types of complex matrices, single and double
COMPLEX_TYPES = (3, 4)


class _Header(NamedTuple):
    """The entry before those of a matrix."""

    form: int
    type: int
    # complex terms are amplitude and phase [degrees], not real and imaginary part
    polar: bool

    @property
    def is_complex(self) -> bool:
        return self.type in COMPLEX_TYPES


class _Term(NamedTuple):
    """One term of a matrix; row and column are point and component."""

    name: str
    column: tuple[int, int]
    row: tuple[int, int]
    value: complex


def read_dmig(path: str | Path) -> dict[str, np.ndarray]:
    """All DMIG matrices of a bulk data or punch file, dense, on the dofs that any of them names.

    Short, long and comma-separated fields are read; symmetric matrices come back whole.

    Returns:
        name to matrix (n, n), and "dofs" (n, 2): point and component of each row, in ascending
        order.

    Raises:
        InputError: no DMIG entry, an entry that cannot be read, or rectangular matrices.
    """
    headers, terms = _headers_and_terms(Path(path))
    _refuse_headers(path, headers, terms)
    dofs = sorted({dof for term in terms for dof in (term.row, term.column)})
    place = {dof: i for i, dof in enumerate(dofs)}
    matrices = {
        name: np.zeros((len(dofs),) * 2, complex if header.is_complex else float)
        for name, header in headers.items()
    }
    for term in terms:
        matrix = matrices[term.name]
        header = headers[term.name]
        i = place[term.row]
        j = place[term.column]
        matrix[i, j] = _matrix_value(term.value, header)
        if header.form == SYMMETRIC_FORM:
            matrix[j, i] = matrix[i, j]
    return matrices | {"dofs": np.array(dofs)}


def _matrix_value(value: complex, header: _Header) -> complex:
    """The value that two fields of a term stand for."""
    if not header.is_complex:
        return value.real
    return rect(value.real, radians(value.imag)) if header.polar else value


def _headers_and_terms(path: Path) -> tuple[dict[str, _Header], list[_Term]]:
    """What the entries of a file say, by the name of the matrix; an entry of point 0 is a header.

    Raises:
        InputError: an entry that cannot be read.
    """
    headers: dict[str, _Header] = {}
    terms: list[_Term] = []
    for number, fields in _read_entries(path):
        try:
            name = fields[1].upper()
            point = int(fields[2])
            if point == 0:
                polar = int([*fields, "", ""][6] or 0) > 0
                headers[name] = _Header(int(fields[3]), int(fields[4]), polar)
            else:
                column = point, int(fields[3] or 0)
                terms += [_Term(name, column, *term) for term in _column_terms(fields[5:])]
        except (ValueError, IndexError) as error:
            raise InputError(
                f"file {path}, line {number}: cannot read the DMIG entry {' '.join(fields)}"
            ) from error
    return headers, terms


def _refuse_headers(path: str | Path, headers: dict[str, _Header], terms: list[_Term]) -> None:
    """Matrices without a header, or rectangular ones."""
    if not terms or {term.name for term in terms} - set(headers):
        raise InputError(f"file {path}: expected DMIG matrices, each with its header")
    wide = [name for name, h in headers.items() if h.form not in (SQUARE_FORM, SYMMETRIC_FORM)]
    if wide:
        raise InputError(
            f"file {path}: {', '.join(wide)} is rectangular, expected square matrices (form 1 or 6)"
        )


def read_ansys(path: str | Path) -> dict[str, np.ndarray]:
    """K and M of an Ansys ``.full`` file, dense, and "dofs" (n, 2): node and degree of freedom of
    each row.

    Constrained degrees of freedom, whose rows are empty, are left out. Ansys' own library reads the
    file (pip install ansys-mapdl-reader); it has no reader for ``.sub``: write the generation pass
    as ``.full``, or as DMIG or Matrix Market.

    Raises:
        InputError: the library is not installed.
    """
    try:
        from ansys.mapdl import reader
    except ImportError as error:
        raise InputError(
            f"file {path}: needs the package ansys-mapdl-reader, which is not installed"
        ) from error
    dofs, K, M = reader.read_binary(str(path)).load_km(as_sparse=False, sort=True)
    whole = [upper + upper.T - np.diag(np.diag(upper)) for upper in (np.triu(K), np.triu(M))]
    free = np.flatnonzero(np.any(whole[0], axis=0) | np.any(whole[1], axis=0))
    K, M = (matrix[np.ix_(free, free)] for matrix in whole)
    return {"K": K, "M": M, "dofs": np.asarray(dofs)[free]}


def _read_entries(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of each DMIG entry with its continuations: [DMIG, name, gj, cj, -, g1,
    c1, a1, b1, ...].

    A short line has eight data fields, a long one four and a second half; continuations begin with
    * + or blanks.
    """
    number = 0
    fields: list[str] = []
    for count, line in enumerate(path.read_text().splitlines(), 1):
        line = line.split("$")[0].rstrip()
        first, data = _split_fields(line)
        if not line:
            continue
        if fields and first[:1] in ("", "*", "+"):
            fields += data
            continue
        # any other line ends the entry before it
        if fields:
            yield number, fields
        number = count
        fields = ["DMIG", *data] if first.upper().rstrip("*") == "DMIG" else []
    if fields:
        yield number, fields


def _split_fields(line: str) -> tuple[str, list[str]]:
    """The first field, and the data fields filled up to eight, or to four in long format."""
    if "," in line:
        first, *data = (part.strip() for part in line.split(","))
        count = 4 if first.endswith("*") or first.startswith("*") else 8
        return first, (data + [""] * 8)[:count]
    first = line[:8].strip()
    width, count = (16, 4) if first.endswith("*") or first.startswith("*") else (8, 8)
    padded = line.ljust(8 + width * count)
    return first, [padded[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]


def _column_terms(fields: list[str]) -> Iterator[tuple[tuple[int, int], complex]]:
    """Row and value of each term: point, component, real and imaginary part."""
    for start in range(0, len(fields), 4):
        point, component, real, imaginary = (fields[start : start + 4] + [""] * 4)[:4]
        if point:
            yield (
                (int(point), int(component or 0)),
                complex(_parse_real(real), _parse_real(imaginary)),
            )


def _parse_real(text: str) -> float:
    """A Nastran real, whose exponent may be written without its letter: 2.5+10, 1.D-3."""
    text = text.upper().replace("D", "E")
    return float(re.sub(r"(?<=[0-9.])([+-])", r"E\1", text)) if text else 0.0
