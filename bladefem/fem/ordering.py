"""Nested dissection for factorisations with rows left out: with a Schur complement MUMPS of Debian
knows AMD only.

METIS is there already, as a library that PETSc's own libraries load. Factors of sectors' interiors
by AMD, by METIS as it is, and by METIS with halves of more equal size (two seeds each):

    dofs                  49 395      73 119      144 159        148 218
    entries [1e6]   AMD   15.1                                   82.7
                    METIS 14.4, 14.8  24.0, 23.6  68.0, 65.6     68.5, 70.1
                    equal 13.7, 13.7  24.1, 24.6  69.0, 68.2     65.8, 64.5
    flops [1e9]     AMD   11.6                                   143
                    METIS 9.4, 10.9   21.3, 19.0  103.9, 86.3    93.6, 104.6
                    equal 7.6, 7.5    21.1, 23.1  102.3, 102.5   76.8, 70.7

The first front of the root has the rows left out beside it: where that decides, equal halves spare
up to a third of the operations; elsewhere they cost up to a fifth more.
"""

from __future__ import annotations

import ctypes
from ctypes.util import find_library

import numpy as np
import scipy.sparse as sp

from .open_matrix import OpenMatrix, chosen_rows, picked

# unknowns from which METIS beats AMD
MIN_METIS_UNKNOWNS = 20_000
# places in METIS's options, and how many there are
METIS_IMBALANCE, METIS_OPTIONS = 16, 40
# thousandths by which the larger half may exceed the smaller one; METIS takes 200
IMBALANCE = 80
METIS_LIBRARIES = ("libmetis.so.5", "libmetis.so", "libmetis.dylib")


def interior_first(
    A: OpenMatrix,
    last: np.ndarray,
    groups: np.ndarray,
) -> np.ndarray | None:
    """(n,) place of each unknown in the elimination: interior by nested dissection, then the rows
    ``last``.

    Args:
        A: symmetric pattern.
        groups: (n,) node of each unknown: unknowns of a node stay together.

    Returns:
        None for small matrices, and where METIS is not there.
    """
    library = _metis_library() if A.shape[0] > MIN_METIS_UNKNOWNS else None
    if library is None:
        return None
    inner = np.setdiff1d(np.arange(A.shape[0]), last)
    _, first, node = np.unique(groups[inner], return_index=True, return_inverse=True)
    # unknowns of a node are coupled with the same nodes: one of them shows these
    heads = inner[first]
    place = _nested_dissection(
        library, _without_diagonal(picked(chosen_rows(A, heads), np.arange(len(heads)), heads))
    )
    if place is None:
        return None
    out = np.empty(A.shape[0], np.int64)
    out[inner[np.argsort(place[node], kind="stable")]] = np.arange(len(inner))
    out[last] = np.arange(len(inner), A.shape[0])
    return out


def _without_diagonal(A: sp.csr_matrix) -> sp.csr_matrix:
    """The pattern (n, n) without its diagonal."""
    found = A.tocoo()
    off = found.row != found.col
    ones = np.ones(np.count_nonzero(off), np.int8)
    return sp.csr_matrix((ones, (found.row[off], found.col[off])), shape=A.shape)


def _nested_dissection(library: ctypes.CDLL, graph: sp.csr_matrix) -> np.ndarray | None:
    """(n,) place of each node (METIS_NodeND)."""
    n = ctypes.c_int32(graph.shape[0])
    starts = graph.indptr.astype(np.int32)
    neighbours = graph.indices.astype(np.int32)
    options = np.empty(METIS_OPTIONS, np.int32)
    library.METIS_SetDefaultOptions(_array_pointer(options))
    options[METIS_IMBALANCE] = IMBALANCE
    order = np.empty(n.value, np.int32)
    place = np.empty(n.value, np.int32)
    failed = (
        library.METIS_NodeND(
            ctypes.byref(n),
            *map(_array_pointer, (starts, neighbours)),
            None,
            _array_pointer(options),
            *map(_array_pointer, (order, place)),
        )
        != 1
    )
    return None if failed else place.astype(np.int64)


def _metis_library() -> ctypes.CDLL | None:
    """The library, if it is there and counts in 32 bits: two nodes without edges are the same input
    for both widths.
    """
    for name in (*METIS_LIBRARIES, find_library("metis") or ""):
        try:
            library = ctypes.CDLL(name) if name else None
        except OSError:
            continue
        if library is None or not hasattr(library, "METIS_NodeND"):
            continue
        n = ctypes.c_int64(2)
        nothing = np.zeros(6, np.int64)
        order = np.full(4, -1, np.int64)
        place = np.full(4, -1, np.int64)
        library.METIS_NodeND(
            ctypes.byref(n),
            _array_pointer(nothing),
            _array_pointer(nothing),
            None,
            None,
            _array_pointer(order),
            _array_pointer(place),
        )
        return library if place[0] != -1 and place[1] == -1 else None
    return None


def _array_pointer(a: np.ndarray) -> ctypes.c_void_p:
    return a.ctypes.data_as(ctypes.c_void_p)
