"""Kernels of 512 bits are asked for on AMD's processors alone, and the user's own word stays."""

from pathlib import Path

import pytest

from bladefem.util.processor import NEEDED, VARIABLE, WIDE_KERNELS, use_wide_registers

WIDE = " ".join(sorted(NEEDED))


@pytest.mark.parametrize(
    ("text", "before", "after"),
    [
        (f"vendor_id\t: AuthenticAMD\nflags\t\t: sse {WIDE}\n", {}, {VARIABLE: WIDE_KERNELS}),
        (f"vendor_id : GenuineIntel\nflags : {WIDE}\n", {}, {}),
        ("vendor_id : AuthenticAMD\nflags : sse avx2 fma avx512f\n", {}, {}),
        (f"vendor_id : AuthenticAMD\nflags : {WIDE}\n", {VARIABLE: "Zen"}, {VARIABLE: "Zen"}),
        ("Features : fp asimd\n", {}, {}),
    ],
)
def test_kernels_that_are_asked_for(
    tmp_path: Path, text: str, before: dict[str, str], after: dict[str, str]
) -> None:
    information = tmp_path / "cpuinfo"
    information.write_text(text)
    use_wide_registers(before, information)
    assert before == after


def test_without_information_nothing_is_set(tmp_path: Path) -> None:
    environment: dict[str, str] = {}
    use_wide_registers(environment, tmp_path / "none")
    assert environment == {}
