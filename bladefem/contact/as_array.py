"""Arrays as callers give them: of the shape that is wanted, and finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError


def as_float_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int | None, ...],
) -> np.ndarray:
    """The value as floats.

    Args:
        name: for the message.
        shape: wanted; None for any length.

    Raises:
        InputError: another shape, or a value that is not finite.
    """
    array = np.asarray(value, dtype=float)
    if len(array.shape) != len(shape) or any(
        w not in (None, n) for n, w in zip(array.shape, shape, strict=True)
    ):
        raise InputError(
            f"{name} has shape {array.shape}, expected "
            f"({', '.join('any' if w is None else str(w) for w in shape)})"
        )
    with np.errstate(all="ignore"):
        # a sixth of the time of looking at each
        suspect = not np.isfinite(array.sum())
    if suspect and not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"{name}{list(where) if where else ''} is {array[where]}, expected finite numbers"
        )
    return array
