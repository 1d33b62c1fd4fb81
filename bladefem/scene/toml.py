"""Scenes as TOML: nested tables of numbers (SI) or texts with units, read, varied, listed and
written back.
"""

from __future__ import annotations

import dataclasses
import difflib
import json
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from ..errors import InputError, suggestion
from .fields import Field, convert_value, display_value, each_field, field_at, value_at
from .kinds import KINDS, kind_named
from .other_blades import whole_entry
from .tables import Scene
from .toml_slips import slip_of_pen
from .units import shortened, show_exactly
from .validate import validate

# the scene inside the folder of a run
FOLDER_SCENE = "scene.toml"
# what is mistaken for a scene: files that 'bladefem look' reads
MESH_SUFFIXES = (".step", ".stp", ".inp", ".cdb", ".bdf", ".nas", ".msh", ".med", ".unv", ".vtu")


class Row(NamedTuple):
    """One line of the resolved table."""

    # dotted
    name: str
    # readable, with its unit
    value: str
    is_default: bool
    help: str


def load_scene(path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """The checked scene of a TOML file.

    Args:
        path: scene file.
        overrides: texts like "aerofoil.twist=25 deg", which win over the file.

    Raises:
        InputError: anything wrong with the file or its content, in one sentence.

    >>> scene = load_scene("scenes/wedge.toml", ["aerofoil.span=130 mm"])
    >>> scene.aerofoil.span, scene.disc.sectors
    (0.13, 36)
    >>> load_scene("scenes/wedge.toml", ["aerofoil.spam=130 mm"])
    Traceback (most recent call last):
        ...
    bladefem.errors.InputError: unknown key 'aerofoil.spam'; did you mean 'aerofoil.span'?
    """
    return scene_of(read_tables(path, overrides), Path(path).resolve().parent)


def read_tables(path: str | Path, overrides: Iterable[str] = ()) -> dict[str, Any]:
    """The nested tables of a scene file as written, with the overrides put in."""
    path = Path(path)
    if path.suffix.lower() in MESH_SUFFIXES:
        raise InputError(
            f"{path}: expected a scene file (TOML), not a mesh or a drawing; 'bladefem look {path} "
            "--scene' writes one for it"
        )
    try:
        # editors on Windows put a byte order mark before the text
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        if path.name == FOLDER_SCENE and path.parent.is_dir():
            raise InputError(
                f"{path.parent}: a folder without {FOLDER_SCENE}, expected a scene file or the "
                f"folder of an earlier run{_nearby_scenes(path)}"
            ) from None
        wanted = "scene file" if path.suffix else "scene file or run folder"
        raise InputError(f"{path}: there is no such {wanted}{_nearby_scenes(path)}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read as a scene file ({error})") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: cannot be read as a scene file, expected text in UTF-8 (byte {error.start} "
            "is none of it); editors save it as such"
        ) from None
    except RecursionError:
        raise InputError(f"{path}: not a scene, its lists or tables are nested too deep") from None
    except ValueError as error:
        # TOMLDecodeError, and integers of more digits than Python converts
        raise InputError(f"{path}: not valid TOML: {error}{slip_of_pen(path, error)}") from None
    for override in overrides:
        name, value = _split_override(override)
        _put_value(tables, name, value)
    if "kind" not in tables:
        raise InputError(
            f"{path}: kind is missing, expected kind = one of "
            f"{', '.join(repr(kind) for kind in KINDS)}"
        )
    return tables


def scene_of(tables: dict[str, Any], folder: str | Path = ".") -> Scene:
    """A checked scene from nested tables; relative file names in it start at ``folder``."""
    scene = _build_table(Scene, tables, "")
    _refuse_unread(scene, sorted(given_keys(tables)))
    scene = kind_named(scene.kind).whole_paths(scene, Path(folder))
    if scene.mistuning.pattern:
        whole = str((Path(folder) / scene.mistuning.pattern).resolve())
        scene = dataclasses.replace(
            scene, mistuning=dataclasses.replace(scene.mistuning, pattern=whole)
        )
    if scene.mistuning.blades:
        blades = tuple(whole_entry(entry, Path(folder)) for entry in scene.mistuning.blades)
        scene = dataclasses.replace(
            scene, mistuning=dataclasses.replace(scene.mistuning, blades=blades)
        )
    if scene.temperature.file:
        whole = str((Path(folder) / scene.temperature.file).resolve())
        scene = dataclasses.replace(
            scene, temperature=dataclasses.replace(scene.temperature, file=whole)
        )
    validate(scene)
    return scene


def vary(scene: Scene, *pair: Any, **changes: Any) -> Scene:
    """A checked copy with other values: ``vary(scene, aerofoil__twist="25 deg")`` or
    ``vary(scene, "aerofoil.twist", "25 deg")``. Numbers are SI.

    Raises:
        InputError: as in :func:`load_scene`.

    >>> vary(Scene(), "damper.angle", "45 deg", "contact.mu", 0.2).contact.mu
    0.2
    >>> vary(Scene(), "damper.angle", "95 deg")
    Traceback (most recent call last):
        ...
    bladefem.errors.InputError: damper.angle = 95 deg: expected 15 deg to 90 deg
    """
    if len(pair) % 2:
        raise InputError(f"vary: expected name and value in turn, got {len(pair)} arguments")
    named = {name.replace("__", "."): value for name, value in changes.items()}
    for name, value in [*zip(pair[::2], pair[1::2], strict=True), *named.items()]:
        scene = _replace_field(scene, name.split("."), value, name)
    _refuse_unread(scene, (*pair[::2], *named))
    validate(scene)
    return scene


def _refuse_unread(scene: Scene, names: Iterable[str]) -> None:
    """Refuse fields that a scene of this kind does not read.

    Raises:
        InputError: the first of them.
    """
    kind = kind_named(scene.kind)
    for name in names:
        if "." in name and not kind.reads(name):
            table = name.split(".")[0]
            read = [one for one in kind.tables if one.startswith(f"{table}.")]
            where, what = (name, "field") if read else (f"[{table}]", "table")
            raise InputError(
                f"{where}: a scene of kind '{scene.kind}' does not use this {what}, expected only "
                f"{', '.join(read or kind.tables)}"
            )


def given_keys(tables: dict[str, Any], path: str = "") -> set[str]:
    """Dotted names of what nested tables give."""
    names: set[str] = set()
    for key, value in tables.items():
        name = f"{path}.{key}" if path else key
        names |= given_keys(value, name) if isinstance(value, dict) else {name}
    return names


def resolved_rows(scene: Scene, given: Iterable[str] | None = None) -> list[Row]:
    """All values that this kind of scene uses; without ``given``, what differs from the default
    counts as given.
    """
    given = None if given is None else set(given)
    rows = []
    for field in _used_fields(scene):
        value = value_at(scene, field.name)
        default = value == field.default if given is None else field.name not in given
        rows.append(
            Row(field.name, display_value(value, field), default, field.meta.get("help", ""))
        )
    return rows


def dump_scene(scene: Scene) -> str:
    """TOML text that :func:`load_scene` turns back into the very same scene, defaults written
    out.
    """
    lines = []
    table = ""
    for field in _used_fields(scene):
        value = value_at(scene, field.name)
        head, _, key = field.name.rpartition(".")
        if head != table:
            lines += ["", f"[{head}]"]
            table = head
        text = f"# {key} = auto" if value is None else f"{key} = {_toml_value(value, field)}"
        lines.append(f"{text:<40s}  # {field.meta['help']}" if field.meta.get("help") else text)
    # TOML is UTF-8; paths in a locale of ASCII have bytes that it does not know
    text = "\n".join(lines) + "\n"
    return text.encode(errors="surrogateescape").decode(errors="replace")


def _build_table(
    table: type,
    data: dict[str, Any],
    path: str,
) -> Any:
    hints = get_type_hints(table)
    leaves = {f.name: f for f in each_field(table, path)}
    values = {}
    for key, value in data.items():
        name = f"{path}.{key}" if path else key
        if key not in hints:
            _refuse_unknown(name, value)
        if dataclasses.is_dataclass(hints[key]):
            if not isinstance(value, dict):
                raise InputError(f"{name} = {shortened(value)}: expected a table [{name}]")
            values[key] = _build_table(hints[key], value, name)
        elif isinstance(value, dict):
            raise InputError(f"[{name}]: expected a single value, not a table")
        else:
            values[key] = convert_value(value, leaves[name])
    return table(**values)


def _refuse_unknown(name: str, value: object) -> None:
    """An unknown table is distinguished from an unknown key."""
    if isinstance(value, dict):
        tables = {f.name.rsplit(".", 1)[0] for f in each_field() if "." in f.name}
        raise InputError(f"unknown table [{name}]{suggestion(name, {*tables, 'material'})}")
    field_at(name)


def _split_override(override: str) -> tuple[str, str]:
    try:
        # a locale of ASCII hands over the command line's letters as bytes that it does not know
        override = override.encode(errors="surrogateescape").decode()
    except UnicodeDecodeError as error:
        raise InputError(f"--set {override!a}: expected letters in UTF-8") from error
    name, equals, value = override.partition("=")
    if not equals or not name.strip():
        raise InputError(f"--set {override}: expected key=value, such as aerofoil.twist='25 deg'")
    return name.strip(), value.strip().strip("'\"")


def _put_value(
    tables: dict[str, Any],
    name: str,
    value: str,
) -> None:
    field_at(name)
    *heads, last = name.split(".")
    for head in heads:
        tables = tables.setdefault(head, {})
        if not isinstance(tables, dict):
            raise InputError(f"{head} = {shortened(tables)}: expected a table [{head}]")
    tables[last] = value


def _replace_field(
    table: Any,
    path: list[str],
    value: object,
    name: str,
) -> Any:
    head, *rest = path
    hints = get_type_hints(type(table))
    if head not in hints:
        field_at(name)
    if rest and dataclasses.is_dataclass(hints[head]):
        return dataclasses.replace(
            table, **{head: _replace_field(getattr(table, head), rest, value, name)}
        )
    if (
        not rest
        and isinstance(value, hints[head] if isinstance(hints[head], type) else ())
        and dataclasses.is_dataclass(value)
    ):
        return dataclasses.replace(table, **{head: value})
    return dataclasses.replace(table, **{head: convert_value(value, field_at(name))})


def _used_fields(scene: Scene) -> Iterable[Field]:
    kind = kind_named(scene.kind)
    return (f for f in each_field() if "." not in f.name or kind.reads(f.name))


def _toml_value(value: Any, field: Field) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml_value(v, field) for v in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(value)
    unit = field.meta.get("unit") or "1"
    if isinstance(value, float):
        return repr(float(value)) if unit == "1" else json.dumps(show_exactly(value, unit))
    return json.dumps(value, ensure_ascii=False)


def _nearby_scenes(path: Path) -> str:
    """The scene of a name like that, in its folder or among the examples next to it; else the
    scenes that there are.
    """
    folders = [folder for folder in (path.parent, path.parent / "scenes") if folder.is_dir()]
    others = {
        str(p): p.stem for folder in folders for p in sorted(folder.glob("*.toml")) if _is_scene(p)
    }
    near = difflib.get_close_matches(path.stem, others.values(), n=1, cutoff=0.6)
    best = [name for name, stem in others.items() if stem in near]
    return suggestion(best[0], best) if best else suggestion("", others) if others else ""


def _is_scene(path: Path) -> bool:
    """A TOML file with a kind of scene in it."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig")).get("kind") in KINDS
    except (OSError, ValueError):
        return False
