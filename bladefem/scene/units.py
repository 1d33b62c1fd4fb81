"""Units at the border: text with a unit becomes an SI number and back. Nothing inside bladefem
knows units.

A unit is a product of powers, "N/mm^3", "kg m^2", "rad/s"; everything after one "/" is in the
denominator until the next "/" or the end. Angles are a dimension of their own, so that a frequency
in Hz and a speed in rad/s cannot be mistaken for each other.
"""

from __future__ import annotations

import re
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from fractions import Fraction
from math import isfinite, pi
from numbers import Real

from ..errors import InputError

# from rad/s to revolutions a minute
RPM = 60 / (2 * pi)
# relative: a value that passes a limit by so much is at it
LIMIT_TOLERANCE = 1e-12
# unit: (factor to SI, exponents of kg, m, s, rad, K)
_UNITS = {
    "m": (1.0, (0, 1, 0, 0, 0)),
    "mm": (1e-3, (0, 1, 0, 0, 0)),
    "cm": (1e-2, (0, 1, 0, 0, 0)),
    "km": (1e3, (0, 1, 0, 0, 0)),
    "um": (1e-6, (0, 1, 0, 0, 0)),
    "nm": (1e-9, (0, 1, 0, 0, 0)),
    "in": (0.0254, (0, 1, 0, 0, 0)),
    "kg": (1.0, (1, 0, 0, 0, 0)),
    "g": (1e-3, (1, 0, 0, 0, 0)),
    "mg": (1e-6, (1, 0, 0, 0, 0)),
    "t": (1e3, (1, 0, 0, 0, 0)),
    "s": (1.0, (0, 0, 1, 0, 0)),
    "ms": (1e-3, (0, 0, 1, 0, 0)),
    "us": (1e-6, (0, 0, 1, 0, 0)),
    "min": (60.0, (0, 0, 1, 0, 0)),
    "h": (3600.0, (0, 0, 1, 0, 0)),
    "N": (1.0, (1, 1, -2, 0, 0)),
    "mN": (1e-3, (1, 1, -2, 0, 0)),
    "kN": (1e3, (1, 1, -2, 0, 0)),
    "MN": (1e6, (1, 1, -2, 0, 0)),
    "Pa": (1.0, (1, -1, -2, 0, 0)),
    "kPa": (1e3, (1, -1, -2, 0, 0)),
    "MPa": (1e6, (1, -1, -2, 0, 0)),
    "GPa": (1e9, (1, -1, -2, 0, 0)),
    "bar": (1e5, (1, -1, -2, 0, 0)),
    "J": (1.0, (1, 2, -2, 0, 0)),
    "mJ": (1e-3, (1, 2, -2, 0, 0)),
    "W": (1.0, (1, 2, -3, 0, 0)),
    "Hz": (1.0, (0, 0, -1, 0, 0)),
    "kHz": (1e3, (0, 0, -1, 0, 0)),
    "rad": (1.0, (0, 0, 0, 1, 0)),
    "mrad": (1e-3, (0, 0, 0, 1, 0)),
    "deg": (pi / 180, (0, 0, 0, 1, 0)),
    "rev": (2 * pi, (0, 0, 0, 1, 0)),
    "rpm": (2 * pi / 60, (0, 0, -1, 1, 0)),
    "K": (1.0, (0, 0, 0, 0, 1)),
    "%": (1e-2, (0, 0, 0, 0, 0)),
    "1": (1.0, (0, 0, 0, 0, 0)),
}
# scales of temperature that do not start at absolute zero: [K] of their zero
_ZEROS = {"degC": 273.15, "°C": 273.15, "C": 273.15}
_SPELLINGS = {
    "µm": "um",
    "μm": "um",
    "°": "deg",
    "degree": "deg",
    "degrees": "deg",
    "percent": "%",
    '"': "in",
}

# SI unit: what an engineer reads, in the order of falling size.
_READABLE = {
    "m": ("m", "mm", "um"),
    "kg": ("kg", "g", "mg"),
    "Pa": ("GPa", "MPa", "kPa", "Pa"),
    "N": ("MN", "kN", "N"),
    "rad": ("deg",),
    "rad/s": ("rpm",),
    "Hz": ("Hz",),
    "kg/m^3": ("kg/m^3",),
    "s": ("s", "ms", "us"),
    "N/m^3": ("N/mm^3",),
    "N/m": ("N/m",),
    "J": ("J", "mJ"),
    "K": ("K",),
}
_NUMBER = re.compile(
    r"\s*([+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf(?:inity)?)\b)\s*"
    r"((?:1/|[^\d\s,.+-]).*?)?\s*",
    re.IGNORECASE,
)
# a number with one comma among its digits
_COMMA = re.compile(r"([+-]?\d+),(\d+)(.*)")
# between the commas of thousands
GROUP_DIGITS = 3
# what a message says of such commas
THOUSANDS = "thousands have no comma"
# one digit: no quantity has a higher power, and exact powers of millions of digits never end
_POWER = re.compile(r"(.+?)\^?(-?\d)?")
# letters of a unit text: longer ones are no units
LONGEST_UNIT = 60
# [N] from which forces are reported in kN
FIRST_KILONEWTONS = 1e4
# from which a plain number is given by a power of ten
FIRST_POWER_OF_TEN = 1e7


def parse(
    value: object,
    unit: str = "1",
    name: str = "value",
) -> float:
    """The SI number of "140 mm" or of a plain number, which is SI already.

    Args:
        value: number, or text of a number and a unit.
        unit: SI unit that is expected; "" or "1" for a plain number.
        name: field name for the error message.

    Raises:
        InputError: no number, an unknown unit, the wrong kind of unit, or not finite.

    >>> parse("140 mm", "m"), parse("40 N/mm^3", "N/m^3"), parse(0.3)
    (0.14, 40000000000.0, 0.3)
    """
    unit = unit or "1"
    number, written = _split_number(value, unit, name)
    if not isfinite(number):
        raise InputError(f"{name} = {shortened(value)}: expected a finite number{_in_unit(unit)}")
    if not written:
        return number
    if unit == "K" and written in _ZEROS:
        return number + _ZEROS[written]
    factor, dimension = _parse_dimension(written, f"{name} = {shortened(value)}", unit)
    _, wanted = _parse_dimension(unit, name)
    if dimension != wanted:
        raise InputError(
            f"{name} = {shortened(value)}: '{written}' is not a unit of this field, expected "
            f"{_unit_examples(unit)}"
        )
    result = number * factor
    if not isfinite(result):
        raise InputError(f"{name} = {shortened(value)}: expected a finite number{_in_unit(unit)}")
    return result


def shortened(value: object, length: int = 60) -> str:
    """The text of a value for a message, cut where it is longer than a line should hold."""
    try:
        text = value if isinstance(value, str) else repr(value)
    except RecursionError:
        return "(deeply nested lists)"
    except ValueError:
        # Python refuses to print integers of more than 4300 digits
        return "(a number of thousands of digits)"
    return text if len(text) <= length else f"{text[:length]}..."


def is_plain(text: str) -> bool:
    """Whether a text is a number without a unit."""
    match = _NUMBER.fullmatch(text)
    return match is not None and not match[2]


def readable_units(unit: str) -> tuple[str, ...]:
    """Units in which people read a quantity that has this SI unit, the largest first."""
    return _READABLE.get(unit, (unit,))


def show(value: float, unit: str = "1", digits: int = 6) -> str:
    """Some digits in the unit that an engineer would write.

    >>> show(0.14, "m"), show(2.1e11, "Pa"), show(267.0353755, "rad/s")
    ('140 mm', '210 GPa', '2550 rpm')
    """
    number, written = _scale_unit(value, unit or "1")
    return f"{number:.{digits}g} {written}".rstrip()


def show_most(limit: float, unit: str = "1", digits: int = 6) -> str:
    """An upper limit like :func:`show`, rounded so that the number shown keeps to it: a value that
    a message expects at most is then taken.

    >>> show(0.00242680731, "m"), show_most(0.00242680731, "m"), show_most(0.14, "m")
    ('2.42681 mm', '2.4268 mm', '140 mm')
    """
    return _show_within(limit, unit, digits, ROUND_FLOOR)


def show_least(limit: float, unit: str = "1", digits: int = 6) -> str:
    """A lower limit like :func:`show`, rounded so that the number shown keeps to it.

    >>> show(0.0012344321, "m"), show_least(0.0012344321, "m"), show_least(0.14, "m")
    ('1.23443 mm', '1.23444 mm', '140 mm')
    """
    return _show_within(limit, unit, digits, ROUND_CEILING)


def _show_within(limit: float, unit: str, digits: int, rounding: str) -> str:
    """The nearest number of some digits where it keeps to a limit to rounding, else the next."""
    number, written = _scale_unit(limit, unit or "1")
    nearest = float(f"{number:.{digits}g}")
    # round-off of a limit such as 0.1 + 0.2 is no reason for another digit; half of what a value
    # may pass its limit by, since reading the number adds round-off of its own
    if abs(nearest - number) > LIMIT_TOLERANCE / 2 * abs(number):
        nearest = float(Context(prec=digits, rounding=rounding).create_decimal_from_float(number))
    return f"{nearest:.{digits}g} {written}".rstrip()


def newtons(force: float, digits: int = 6) -> str:
    """A force in words of a report: in N, from ten thousand on in kN, so that no power of ten is
    read.

    >>> newtons(2.25), newtons(1100.0), newtons(49999.6, 4), newtons(0.0)
    ('2.25 N', '1100 N', '50 kN', '0 N')
    """
    rounded = float(f"{force:.{digits}g}")
    if abs(rounded) >= FIRST_KILONEWTONS:
        return f"{plain_number(rounded / 1e3, digits)} kN"
    return f"{plain_number(rounded, digits)} N"


def newton_range(low: float, high: float, digits: int = 4) -> str:
    """Two forces in the unit of the larger one.

    >>> newton_range(900.0, 1100.0), newton_range(9000.0, 5e4)
    ('900 to 1100 N', '9 to 50 kN')
    """
    text = newtons(high, digits)
    factor = 1e-3 if text.endswith("kN") else 1.0
    return f"{plain_number(low * factor, digits)} to {text}"


def plain_number(value: float, digits: int = 6) -> str:
    """So many significant digits without a power of ten, but for numbers that nobody would write
    out: the rule of cells of tables and of forces in sentences.

    >>> plain_number(5e4, 4), plain_number(123456.7, 4), plain_number(2.1e11, 4)
    ('50000', '123500', '2.1e+11')
    """
    text = f"{value:.{digits}g}"
    if "e+" in text and abs(value) < FIRST_POWER_OF_TEN:
        return f"{float(text):.0f}"
    return text


def show_exactly(value: float, unit: str = "1") -> str:
    """Like :func:`show`, but with as many digits as bring the very same number back through
    :func:`parse`.
    """
    number, written = _scale_unit(value, unit or "1")
    for digits in (6, 12, 15, 16, 17):
        text = f"{number:.{digits}g} {written}".rstrip()
        if parse(text, unit) == value:
            return text
    return f"{float(value)!r} {'' if unit in ('', '1') else unit}".rstrip()


def _split_number(
    value: object,
    unit: str,
    name: str,
) -> tuple[float, str]:
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            return float(value), ""
        except OverflowError:
            raise InputError(
                f"{name} = {shortened(value)}: expected a finite number{_in_unit(unit)}"
            ) from None
    if not isinstance(value, str):
        raise InputError(f"{name} = {shortened(value)}: expected a number{_in_unit(unit)}")
    match = _NUMBER.fullmatch(value)
    if not match:
        meant = meant_by_comma(value)
        raise InputError(f"{name} = {shortened(repr(value))}: expected {_expected(unit)}{meant}")
    return float(match[1]), match[2] or ""


def meant_by_comma(text: str, quote: str = "'") -> str:
    """The end of a message on a number with a comma, as half of the world writes decimals and the
    other half thousands; nothing where it has another fault.

    >>> meant_by_comma("140,5 mm"), meant_by_comma("1, 2"), meant_by_comma("1,2,3")
    ("; decimals have a point, '140.5 mm'", '', '')
    >>> meant_by_comma("12,000 rpm")
    "; thousands have no comma and decimals a point, '12000 rpm' or '12.000 rpm'"
    """
    found = _COMMA.fullmatch(text.strip())
    point = found.expand(r"\1.\2\3") if found else ""
    if not found or not _NUMBER.fullmatch(point):
        return ""
    whole_part = found[1].lstrip("+-")
    grouped = len(found[2]) == GROUP_DIGITS and len(whole_part) <= GROUP_DIGITS
    if not grouped or whole_part.startswith("0"):
        return f"; decimals have a point, {quote}{point}{quote}"
    whole = found.expand(r"\1\2\3")
    return f"; {THOUSANDS} and decimals a point, {quote}{whole}{quote} or {quote}{point}{quote}"


def _parse_dimension(
    text: str,
    where: str,
    wanted: str = "1",
) -> tuple[float, tuple[int, ...]]:
    """Factor to SI and exponents of a product of powers; ``wanted`` is the SI unit that a message
    about an unknown one tells.
    """
    if len(text) > LONGEST_UNIT:
        raise _unknown_unit(text, where, wanted)
    # exact: 7.85 g/cm^3 is 7850, not 7849.999...
    factor = Fraction(1)
    exponents = [0, 0, 0, 0, 0]
    for place, part in enumerate(text.replace("**", "^").split("/")):
        for word in filter(None, re.split(r"[ *·]+", part)):
            size, dimension, power = _parse_unit(word, where, wanted)
            power = power if place == 0 else -power
            factor *= Fraction(str(size)) ** power
            exponents = [e + power * d for e, d in zip(exponents, dimension, strict=True)]
    try:
        return float(factor), tuple(exponents)
    except OverflowError:
        raise InputError(f"{where}: expected a unit of this world, not {text}") from None


def _parse_unit(word: str, where: str, wanted: str) -> tuple[float, tuple[int, ...], int]:
    word = word.replace("²", "^2").replace("³", "^3")
    for candidate, power in ((word, 1), *_split_powers(word)):
        candidate = _SPELLINGS.get(candidate, candidate)
        if candidate in _UNITS:
            return *_UNITS[candidate], power
    raise _unknown_unit(word, where, wanted)


def _unknown_unit(word: str, where: str, wanted: str) -> InputError:
    return InputError(
        f"{where}: unknown unit '{shortened(word, 20)}', expected {_unit_examples(wanted)}"
    )


def _split_powers(word: str) -> list[tuple[str, int]]:
    match = _POWER.fullmatch(word)
    return [(match[1], int(match[2]))] if match and match[2] else []


def _scale_unit(value: float, unit: str) -> tuple[float, str]:
    """The number and the readable unit in which its size is at least one."""
    names = _READABLE.get(unit, (unit,))
    for name in names:
        number = value / _parse_dimension(name, unit)[0]
        if abs(number) >= 1 and value != 0:
            break
    if value == 0:
        number = 0.0
        name = unit if unit in names else names[-1]
    return number, "" if name == "1" else name


def _in_unit(unit: str) -> str:
    return "" if unit == "1" else f" in {unit}"


def _expected(unit: str) -> str:
    examples = _unit_examples(unit)
    return examples if unit == "1" else f"a number with a unit such as {examples}"


def _unit_examples(unit: str) -> str:
    if unit == "1":
        return "a plain number or %"
    known = [*_READABLE.get(unit, ()), *(("degC",) if unit == "K" else ()), unit]
    return " or ".join(dict.fromkeys(known))
