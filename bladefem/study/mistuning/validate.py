"""What a mistuned scene asks for, read from the scene alone: refused before any long work where it
cannot be run.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...scene.fields import value_at
from ...scene.kinds import kind_named
from ...scene.other_blades import other_blades
from ...scene.tables import Scene
from ...wheel.pattern_file import BladeDeviations, frequency_deviations, read_deviations
from ...wheel.scatter import Scatter, drawn_deviations
from .engine_orders import read_orders

# mistuning.level: all wheels by the law of one damper
LAW_LEVEL = "damper law"


def is_mistuned(scene: Scene) -> bool:
    """The scene gives how its blades differ."""
    given = scene.mistuning
    return any(x is not None for x in (given.pattern, given.scatter, given.blades))


def check_mistuning(scene: Scene) -> None:
    """Refuse what cannot be run before long work.

    Raises:
        InputError: the pattern, the engine orders or the kind of scene do not fit.
    """
    if not is_mistuned(scene):
        return
    count = _wheel_blades(scene)
    scene_deviations(scene, count, scene.mistuning.families)
    other_blades(scene, count)
    if read_orders(scene) and scene.mistuning.level == LAW_LEVEL:
        raise InputError(
            'mistuning.level = "damper law": takes one engine order, expected no mistuning.orders '
            'or "whole wheel"'
        )


def refuse_scatter(scene: Scene) -> None:
    """Refuse what 'bladefem scatter' cannot draw.

    Raises:
        InputError: the scene has no wheel, no scatter, one of zero, or several damper masses.
    """
    _wheel_blades(scene)
    if scene.mistuning.scatter is None:
        raise InputError(
            "mistuning.scatter: expected a relative standard deviation of the blades' "
            "frequencies, such as '1 %', for 'bladefem scatter'"
        )
    given = scene.mistuning
    if not any(
        (given.scatter, given.friction, given.stiffness, given.load, given.mass, given.traction)
    ):
        raise InputError(
            "mistuning.scatter = 0: all wheels that 'bladefem scatter' draws are alike, expected "
            "more than 0, or a scatter of the dampers such as mistuning.friction = '10 %'"
        )
    if len(scene.study.masses or ()) > 1:
        raise InputError(
            f"study.masses: {len(scene.study.masses or ())} damper masses, expected one for "
            "'bladefem scatter'"
        )
    if scene.mistuning.traction > 0 and scene.mistuning.level == LAW_LEVEL:
        raise InputError(
            f"mistuning.traction = {scene.mistuning.traction:g}: the law of one damper knows one "
            'state of its friction forces, expected mistuning.level = "whole wheel"'
        )


def _wheel_blades(scene: Scene) -> int:
    """Number of blades of the scene's wheel.

    Raises:
        InputError: it has none.
    """
    name = kind_named(scene.kind).sectors
    if name is None:
        raise InputError(f"mistuning: a scene of kind '{scene.kind}' has no wheel")
    count = int(value_at(scene, name))
    if count == 0:
        raise InputError("mistuning: expected a wheel, imported.sectors = 0 has a single blade")
    return count


def scene_deviations(
    scene: Scene,
    count: int,
    families: int,
) -> BladeDeviations:
    """Relative deviations of the blades: of the file, or the first ones drawn.

    Raises:
        InputError: neither is given, the file does not fit, or a blade would be unstable.
    """
    given = scene.mistuning
    if given.pattern:
        return read_deviations(given.pattern, count, families)
    if given.scatter is None and given.blades:
        return frequency_deviations(np.zeros((count, families)))
    if given.scatter is None:
        raise InputError("mistuning: expected a pattern file or a scatter")
    # the same first wheel as the statistics draw
    scatter = Scatter(given.scatter, seed=given.seed)
    deviation = drawn_deviations(count, scatter, 1).blades[0]
    return frequency_deviations(np.repeat(deviation[:, None], families, axis=1))


def scene_scatter(scene: Scene) -> Scatter:
    """The scene's standard deviations."""
    m = scene.mistuning
    return Scatter(m.scatter or 0.0, m.friction, m.stiffness, m.load, m.mass, m.traction, m.seed)
