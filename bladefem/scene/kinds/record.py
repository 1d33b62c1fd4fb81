"""What a kind of scene is made of: one record, read wherever a kind decides something."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from ..fields import value_at
from ..tables import Scene

# tables that every kind with a blade reads
COMMON_TABLES = ("mesh", "material", "contact", "study", "model")
# what those read of these that press two bodies together, and no more
PRESSED_TABLES = ("mesh", "material", "study.loads")
# tables of the kinds that vibrate in an engine
ENGINE_TABLES = (
    *COMMON_TABLES,
    "operation",
    "temperature",
    "excitation",
    "solver",
    "support",
    "fatigue",
)


def no_conditions(_: Scene) -> Iterator[str]:
    """No condition between the fields."""
    return iter(())


def nothing_unread(_: Scene) -> tuple[str, ...]:
    """All that its tables have is read."""
    return ()


def no_files(_: Scene) -> tuple[Path, ...]:
    """None."""
    return ()


def always(_: Scene) -> bool:
    """True."""
    return True


def same_paths(scene: Scene, _: Path) -> Scene:
    """The scene of a kind that names no file."""
    return scene


@dataclass(frozen=True)
class SceneCall:
    """A function that takes parts of a scene."""

    # "module:function"; the module is loaded when it is called
    function: str
    # fields or tables of the scene
    arguments: tuple[str, ...]

    def __call__(self, scene: Scene, **others: Any) -> Any:
        """The function's result; others are passed on by name."""
        values = (value_at(scene, name) for name in self.arguments)
        return load_function(self.function)(*values, **others)


@dataclass(frozen=True)
class Kind:
    """One kind of scene. A new kind, such as a new shape of damper, is one file with one record."""

    # as scenes write it
    name: str
    # tables of the scene that it reads, or single fields of them ("study.loads"); the others must
    # not be given
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
    # a model in two dimensions: no length along the engine axis, no rotation
    is_plane: bool = False
    # field with the number of blades of the wheel
    sectors: str | None = None
    # angles [rad] of both flanks against the radial plane between two blades
    flank_angles: Callable[[Scene], tuple[float, float]] | None = None
    # damper.clearance is a gap of the mesh already
    clearance_is_meshed: bool = True
    # why a load of zero is refused
    without_load: str = "a damper without load lifts off"
    # refuses what cannot be drawn, by arithmetic on the shape's tables
    check: SceneCall | None = None
    # a lower bound of the number of cells
    cells: SceneCall | None = None
    # what a run would refuse later on and the scene alone can tell: "module:function" of it
    preflight: str | None = None
    # faces and node sets that a force can act on; None where a file names them
    face_names: Callable[[Scene], tuple[str, ...]] | None = None
    # the same from the file, which is read and drawn for it but not meshed
    file_names: SceneCall | None = None
    # drawings of the parameters by name, each taking ``file``
    pictures: Mapping[str, SceneCall] = field(default_factory=dict)
    # the scene with whole paths, from the folder that its own start from
    whole_paths: Callable[[Scene, Path], Scene] = same_paths
    # files that it reads
    files: Callable[[Scene], tuple[Path, ...]] = no_files
    # whether elements are made here, so that their sizes can be studied
    meshed_here: Callable[[Scene], bool] = always
    # conditions between the fields of a scene, one sentence for each that does not hold
    conditions: Callable[[Scene], Iterator[str]] = no_conditions
    # fields of its tables that are allowed and change nothing: reported where they are not the
    # default
    unread: Callable[[Scene], tuple[str, ...]] = nothing_unread
    # dimension name to length [m] of the parts that an element must fit into; None: unknown
    thin_parts: Callable[[Scene], dict[str, float]] | None = None
    # radius of name [m] of what moves fastest, for a check of the speed
    radii: Callable[[Scene], dict[str, float]] | None = None

    def reads(self, name: str) -> bool:
        """Whether a field ("study.loads") or anything of a table matters to this kind."""
        return any(name == one or name.startswith(f"{one}.") for one in self.tables) or any(
            one.startswith(f"{name}.") for one in self.tables
        )


def load_function(reference: str) -> Callable[..., Any]:
    """The function that "module:function" names; its module is loaded now and not before."""
    module, name = reference.split(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function
