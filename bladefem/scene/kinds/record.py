"""What a kind of scene is made of: one record, read wherever a kind decides something."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ..tables import Scene

# tables that every kind reads
COMMON_TABLES = ("mesh", "material", "contact", "study", "model")
# tables of the kinds that vibrate in an engine
ENGINE_TABLES = (*COMMON_TABLES, "operation", "excitation", "solver", "support")


def no_conditions(_: Scene) -> Iterator[str]:
    """No condition between the fields."""
    return iter(())


def always(_: Scene) -> bool:
    """True."""
    return True


@dataclass(frozen=True)
class Kind:
    """One kind of scene. A new kind, such as a new shape of damper, is one file with one record."""

    # as scenes write it
    name: str
    # tables of the scene that it reads; the others must not be given
    tables: tuple[str, ...]
    # "module:function" that draws and meshes it
    builder: str
    # the builder's arguments, fields or tables of the scene: also what its mesh depends on
    shape: tuple[str, ...]
    # "module:function" of (scene, folder, comm, progress) that does all of `bladefem run`
    runner: str
    # "module:function" of what the runner returns, to the table that the command ends with
    table: str
    # what the runner computes, in words
    result: str
    # a blade vibrates: modes and responses exist
    has_blade: bool = True
    # a damper sits on two seats
    has_seats: bool = True
    # seats may be meshed in a grid (mesh.seat_elements)
    has_seat_grid: bool = False
    # friction moves in one direction only, so that its events can be located exactly
    has_one_tangent: bool = False
    # field with the damper's mass where it is not the meshed one
    damper_mass: str = "damper.mass"
    # whether elements are made here, so that their sizes can be studied
    meshed_here: Callable[[Scene], bool] = always
    # conditions between the fields of a scene, one sentence for each that does not hold
    conditions: Callable[[Scene], Iterator[str]] = no_conditions
    # dimension name to length [m] of the parts that an element must fit into; None: unknown
    thin_parts: Callable[[Scene], dict[str, float]] | None = None
    # radius of name [m] of what moves fastest, for a check of the speed
    radii: Callable[[Scene], dict[str, float]] | None = None


def load_function(reference: str) -> Callable[..., Any]:
    """The function that "module:function" names; its module is loaded now and not before."""
    module, name = reference.split(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function
