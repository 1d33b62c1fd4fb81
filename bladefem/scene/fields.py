"""One field of a scene: what a user wrote becomes a checked SI value of the field's own type."""

from __future__ import annotations

import dataclasses
import re
import unicodedata
from collections.abc import Iterator, Mapping
from math import isfinite
from types import NoneType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from ..errors import InputError, suggestion
from .tables import Scene
from .units import is_plain, parse, readable_units, shortened, show

# of one field: every load is a sweep of its own
MOST_VALUES = 1000
SUGGESTION_START = "did you mean '"
# ends of a text that gives a share
PERCENT = ("%", "percent")
# "1,5 g", which half of the world writes for 1.5 g
_AMBIGUOUS_COMMA = re.compile(r"\s*([+-]?\d+),(\d+\s*[^\s\d.,+-][^,]*?)\s*")
# a number and a word, no power of ten
_WITH_LETTERS = re.compile(r"\s*[-+]?[\d.]+\s*[a-df-zA-DF-Z]\S*\s*")
# "36,80 N, 90 N": two values or three
_MIXED_COMMAS = re.compile(r"\d,\d.*,\s|,\s.*\d,\d")


class Field(NamedTuple):
    """A leaf of the scene."""

    # dotted, "aerofoil.twist"
    name: str
    # type hint: float, int | None, tuple[float, ...], ...
    kind: Any
    # unit, low, high, help, choices
    meta: Mapping[str, Any]
    default: Any


def each_field(table: type = Scene, path: str = "") -> Iterator[Field]:
    """All leaves of a (nested) dataclass, in the order in which they are written."""
    hints = get_type_hints(table)
    for f in dataclasses.fields(table):
        name = f"{path}.{f.name}" if path else f.name
        if dataclasses.is_dataclass(hints[f.name]):
            yield from each_field(hints[f.name], name)
        else:
            yield Field(name, hints[f.name], dict(f.metadata), f.default)


def field_at(name: str) -> Field:
    """The leaf of that dotted name, or an error that names the nearest one."""
    known = {f.name: f for f in each_field()}
    if name in known:
        return known[name]
    last = name.rsplit(".", 1)[-1]
    same = [k for k in known if k.rsplit(".", 1)[-1] == last]
    tables = sorted({_table_name(k) for k in known if "." in k})
    if name in tables:
        raise InputError(
            f"{name}: expected a field of this table, such as "
            f"{next(k for k in known if k.startswith(name + '.'))}"
        )
    head = _table_name(name)
    inside = [k.rpartition(".")[2] for k in known if _table_name(k) == head]
    # excitation.order is rather excitation.engine_order than mesh.order
    longer = [word for word in inside if head and last in word.split("_")]
    if longer:
        raise InputError(f"unknown key '{name}'; did you mean '{head}.{longer[0]}'?")
    if same:
        raise InputError(f"unknown key '{name}'; did you mean '{same[0]}'?")
    if head in tables:
        near = suggestion(last, inside)
        raise InputError(
            f"unknown key '{name}'{near.replace(SUGGESTION_START, f'{SUGGESTION_START}{head}.')}"
        )
    outside = [*tables, *(k for k in known if not _table_name(k))]
    raise InputError(
        f"unknown key '{name}'{_similar_words(name, known) or suggestion(name, outside)}"
    )


def _table_name(name: str) -> str:
    return name.rpartition(".")[0]


def value_at(scene: Scene, name: str) -> Any:
    """The value of a dotted field."""
    value: Any = scene
    for part in name.split("."):
        value = getattr(value, part)
    return value


def convert_value(value: object, field: Field) -> Any:
    """The SI value of a field from what was written, of the field's own type and within its range.

    ``None`` and "auto" leave an optional field to the program.

    Raises:
        InputError: wrong type, wrong unit, out of range, not finite, or not one of the choices.
    """
    kind = field.kind
    if NoneType in get_args(kind):
        if value is None or value == "auto":
            return None
        kind = next(k for k in get_args(kind) if k is not NoneType)
    if get_origin(kind) is tuple:
        return _parse_tuple(value, get_args(kind), field)
    if str in get_args(kind):
        return _word_or_values(value, field)
    return _SCALARS[kind](value, field)


def _parse_float(value: object, field: Field) -> float:
    return _in_range(parse(value, field.meta.get("unit") or "1", field.name), field, value)


def _parse_int(value: object, field: Field) -> int:
    if isinstance(value, str) and not any(letter.isdigit() for letter in value):
        raise InputError(f"{field.name} = {shortened(repr(value))}: expected {_whole(field)}")
    if isinstance(value, str) and _WITH_LETTERS.fullmatch(value):
        # a count has no unit, and % is none that a message should offer
        raise InputError(f"{field.name} = {shortened(value)}: expected {_whole(field)}")
    number = parse(value, "1", field.name)
    if number != int(number):
        raise InputError(f"{field.name} = {value}: expected {_whole(field)}")
    return _in_range(int(number), field, value)


def _whole(field: Field) -> str:
    """ "a whole number from 6 to 200", as far as the field has a range."""
    low, high = (field.meta.get(end) for end in ("low", "high"))
    if low is None or high is None or not (isfinite(low) and isfinite(high)):
        return "a whole number"
    return f"{low:g} or {high:g}" if high == low + 1 else f"a whole number from {low:g} to {high:g}"


def _parse_bool(value: object, field: Field) -> bool:
    words = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
    if isinstance(value, str) and value.lower() in words:
        return words[value.lower()]
    if not isinstance(value, bool):
        expected = "true, false or auto" if field.default is None else "true or false"
        raise InputError(f"{field.name} = {shortened(value)}: expected {expected}")
    return value


def _parse_text(value: object, field: Field) -> str:
    if not isinstance(value, str):
        raise InputError(f"{field.name} = {shortened(value)}: expected text")
    if any(unicodedata.category(letter) == "Cc" for letter in value):
        raise InputError(f"{field.name} = {shortened(repr(value))}: expected one line of text")
    choices = field.meta.get("choices") or ()
    if choices and value not in choices:
        raise InputError(
            f"{field.name} = {shortened(repr(value))}: expected one of "
            f"{', '.join(choices)}{_similar_words(value, choices)}"
        )
    return value


_SCALARS = {float: _parse_float, int: _parse_int, bool: _parse_bool, str: _parse_text}


def _parse_tuple(
    value: object,
    kinds: tuple[Any, ...],
    field: Field,
) -> tuple[Any, ...]:
    items = _list_items(value)
    length = None if kinds[-1] is Ellipsis else len(kinds)
    if length is not None and len(items) != length:
        raise InputError(f"{field.name} = {shortened(value)}: expected {length} values")
    if length is None and isinstance(value, str) and (comma := _AMBIGUOUS_COMMA.fullmatch(value)):
        whole, rest = comma.groups()
        thousands = f"'{whole}{rest}', " if re.match(r"\d{3}(?!\d)", rest) else ""
        raise InputError(
            f"{field.name} = '{shortened(value)}': one value or two, expected {thousands}"
            f"'{whole}.{rest}' or '{whole}, {rest}'"
        )
    if length is None and isinstance(value, str) and _MIXED_COMMAS.search(value):
        raise InputError(
            f"{field.name} = '{shortened(value)}': some commas are followed by a space and some "
            "are not, expected a space after each comma between values, and decimals with a point"
        )
    if not items:
        shown = shortened(value) if value else repr(value)
        raise InputError(f"{field.name} = {shown}: expected at least one value")
    if len(items) > MOST_VALUES:
        raise InputError(f"{field.name}: {len(items)} values given, expected at most {MOST_VALUES}")
    return tuple(_SCALARS[kinds[0]](item, field) for item in items)


def split_values(text: str) -> list[str]:
    """Single values of a text like "20, 50, 100 N", where the last unit holds for those without
    one.
    """
    inner = text.strip()
    if (inner[:1], inner[-1:]) in (("[", "]"), ("(", ")")):
        inner = inner[1:-1]
    items = [item.strip(" '\"") for item in inner.split(",") if item.strip()]
    last = items[-1] if items else ""
    unit = last.lstrip("+-.0123456789eE_ ") if last[:1] in tuple("+-.0123456789") else ""
    # a row of a table such as "600 degC: E=210 GPa" is no number with a unit
    if set(unit) & set(":="):
        unit = ""
    return [f"{item} {unit}" if unit and item[-1] in "0123456789." else item for item in items]


def _word_or_values(value: object, field: Field) -> Any:
    """One of the choices of the field, or a list of numbers."""
    choices = field.meta.get("choices") or ()
    if isinstance(value, str) and value in choices:
        return value
    if isinstance(value, str) and not any(letter.isdigit() for letter in value):
        raise InputError(
            f"{field.name} = {shortened(repr(value))}: expected one of {', '.join(choices)}, or a "
            f"list of values with units{_similar_words(value, choices)}"
        )
    kind = next(k for k in get_args(field.kind) if get_origin(k) is tuple)
    return _parse_tuple(value, get_args(kind), field)


def _list_items(value: object) -> list[Any]:
    if isinstance(value, str):
        return split_values(value)
    return list(value) if hasattr(value, "__iter__") else [value]


def _in_range(
    number: Any,
    field: Field,
    written: object = "",
) -> Any:
    low = field.meta.get("low")
    high = field.meta.get("high")
    unit = field.meta.get("unit") or "1"
    if _within_range(number, low, high):
        return number
    share = unit == "1" and isinstance(written, str) and written.rstrip().endswith(PERCENT)
    # limits as the value was written: 200 % is to be read against 0 % to 50 %
    unit = "%" if share else unit
    if low is not None and high is not None:
        between = "or" if isinstance(number, int) and high == low + 1 else "to"
        limit = f"{show(low, unit)} {between} {show(high, unit)}"
    else:
        bounds = {"at least": low, "at most": high}
        limit = " ".join(f"{word} {show(n, unit)}" for word, n in bounds.items() if n is not None)
    # -300 degC would be shown as -26.85 K, which nobody wrote
    kept = share or (unit == "K" and isinstance(written, str))
    shown = shortened(written) if kept else show(number, unit)
    raise InputError(f"{field.name} = {shown}: expected {limit}{_forgotten_unit(written, field)}")


def _within_range(
    number: float,
    low: float | None,
    high: float | None,
) -> bool:
    """Within a range, round-off apart: "10 um" is 9.999...e-06."""
    return (low is None or number >= low - 1e-12 * abs(low)) and (
        high is None or number <= high + 1e-12 * abs(high)
    )


def _forgotten_unit(written: object, field: Field) -> str:
    """The tail of a message where a plain number would do in the unit that people use: 65 was meant
    as 65 deg.
    """
    # "1_0" is a number too, which nobody writes with a unit
    number = str(written).strip().replace("_", "")
    meta = field.meta
    unit = meta.get("unit") or "1"
    for name in readable_units(unit) if is_plain(number) else ():
        if name != unit and _within_range(
            parse(f"{number} {name}", unit), meta.get("low"), meta.get("high")
        ):
            return f"; did you mean '{number} {name}'?"
    return ""


def _similar_words(word: str, known: Any) -> str:
    near = suggestion(word, known)
    return near if "did you mean" in near else ""


def display_value(value: Any, field: Field) -> str:
    """A value as people read it, with its unit; "auto" for None."""
    if value is None:
        return "auto"
    if isinstance(value, tuple):
        return ", ".join(display_value(v, field) for v in value)
    if isinstance(value, float):
        return show(value, field.meta.get("unit") or "1")
    return str(value).lower() if isinstance(value, bool) else str(value)
