"""Memory that this process has in the machine."""

import resource
from pathlib import Path

import pytest

READINGS = Path("/proc/self/statm")
needs_readings = pytest.mark.skipif(not READINGS.exists(), reason=f"no {READINGS}")


def resident_memory() -> int:
    """[bytes]"""
    return int(READINGS.read_text().split()[1]) * resource.getpagesize()
