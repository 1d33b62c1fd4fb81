"""The chart library of a page with script: plotly.js from its PyPI wheel, compressed, inlined.

Browsers unpack it themselves (DecompressionStream), so that a page works offline and stays small.
"""

from __future__ import annotations

import base64
import gzip
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path


@dataclass(frozen=True)
class Library:
    """A script for a page."""

    # base64 of the gzipped script
    packed: str
    version: str

    @property
    def megabytes(self) -> float:
        """Size that it adds to a page [MB]."""
        return len(self.packed) / 1e6


@lru_cache(maxsize=1)
def chart_library() -> Library | None:
    """plotly.js; None where the wheel is not installed, and pages then hold pictures only."""
    spec = find_spec("plotly")
    if spec is None or not spec.submodule_search_locations:
        return None
    file = Path(next(iter(spec.submodule_search_locations))) / "package_data" / "plotly.min.js"
    if not file.is_file():
        return None
    # without a time stamp, so that equal inputs give equal pages
    packed = gzip.compress(file.read_bytes(), 9, mtime=0)
    return Library(base64.b64encode(packed).decode(), metadata.version("plotly"))
