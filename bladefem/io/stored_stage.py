"""A stage of a run folder as it is there, whatever it was made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .array_codec import read_npz


def stored_stage(folder: str | Path, name: str) -> Any:
    """The result of a stage.

    Raises:
        InputError: the folder does not hold it, or an older program made it.
    """
    path = Path(folder) / "stages" / f"{name}.npz"
    try:
        with np.load(path, allow_pickle=False) as file:
            key = str(file["key"])
        result, _seconds = read_npz(path, key)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path}: the stage '{name}' cannot be read ({error})") from None
    return result
