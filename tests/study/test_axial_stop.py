"""`damper.axial = "held"` in the vibration: a free body without its translation along the axis."""

from __future__ import annotations

import numpy as np
import pytest

from bladefem.data import PortModel
from bladefem.errors import InputError
from bladefem.study.pipeline.assemble_model import hold_translation

POINTS = np.array([[0.0, 1.0, 0.3], [2.0, -1.0, 0.5], [-1.0, 0.4, -0.8], [0.5, -0.2, 0.4]])


def free_body(seed=3):
    """Four unit masses joined by springs: rigid modes and one elastic mode at 12 contact dofs."""
    x = POINTS - POINTS.mean(axis=0)
    moves = [np.tile(axis, (4, 1)).ravel() for axis in np.eye(3)]
    turns = [np.cross(axis, x).ravel() for axis in np.eye(3)]
    rigid, _ = np.linalg.qr(np.array(moves + turns).T)
    mixed = rigid @ np.linalg.qr(np.random.default_rng(seed).normal(size=(6, 6)))[0]
    whole, _ = np.linalg.qr(np.column_stack([mixed, np.eye(12)[:, :1]]))
    shapes = np.column_stack([mixed, whole[:, 6]])
    return PortModel(
        np.array([0.0] * 6 + [50.0]), shapes, np.zeros((12, 12)), {"contact": slice(0, 12)}
    )


def test_a_held_body_turns_and_bends_but_does_not_move_along_the_axis():
    body = free_body()
    along = np.tile([0.0, 0.0, 1.0], 4)
    held = hold_translation(body, along)
    assert np.count_nonzero(held.omega == 0) == 5
    # the centre of mass rests, whatever the modes do
    assert abs(along @ held.shapes).max() < 1e-12
    # what remains is the free body with an infinite mass along the axis
    frequency = 7.0
    G, stopped = ((b.shapes / (b.omega**2 - frequency**2)) @ b.shapes.T for b in (body, held))
    reaction = along / np.linalg.norm(along)
    expected = G + np.outer(reaction, reaction) / frequency**2
    np.testing.assert_allclose(stopped, expected, atol=1e-12)


def test_a_body_that_does_not_move_along_the_axis_cannot_be_held():
    held = hold_translation(free_body(), np.tile([0.0, 0.0, 1.0], 4))
    with pytest.raises(InputError, match="no rigid motion along the engine axis"):
        hold_translation(held, np.tile([0.0, 0.0, 1.0], 4))
