"""Few contact points of a seat carry the forces and moments of all its nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bladefem.contact.interface_elements import friction_elements
from bladefem.contact.joined_points import (
    aggregation_matrix,
    element_labels,
    element_patch,
    joined_motion,
)
from bladefem.data import Patch, PressureMap
from bladefem.scene.tables import Contact

LENGTH, WIDTH = 14e-3, 8e-3


def seat(name="this", rows=9, columns=7, turned=0.4):
    """A turned seat whose nodes at the edges have half the area of the others."""
    t, s = np.linspace(0, LENGTH, rows), np.linspace(0, WIDTH, columns)
    area = np.outer(ends_halved(rows), ends_halved(columns)).ravel()
    c, n = np.cos(turned), np.sin(turned)
    frame = np.array([[0.0, 0.0, 1.0], [c, n, 0.0], [-n, c, 0.0]])
    x = np.array([[a, b] for a in t for b in s]) @ frame[1:]
    count = rows * columns
    return Patch(
        name,
        x,
        area * LENGTH * WIDTH / area.sum(),
        np.tile(frame, (count, 1, 1)),
        np.empty((0, 3), int),
        np.zeros(count, int),
    )


def ends_halved(count):
    weight = np.ones(count)
    weight[[0, -1]] = 0.5
    return weight


def linear_motions(patch):
    """(n, 3) normal motion of a rigid seat that is pressed and tilted about its two axes."""
    return np.column_stack([np.ones(len(patch.area)), patch.points @ patch.frame[0, 1:].T])


@pytest.mark.parametrize("points", [4, 6, 8, 16, 32])
def test_a_rigid_seat_feels_the_stiffness_of_all_nodes(points):
    patches = [seat(), seat("next", 8, 6, turned=-0.7)]
    rng = np.random.default_rng(3)
    stiffness = [1e9 * patch.area * rng.uniform(0.5, 2.0, len(patch.area)) for patch in patches]
    groups = element_labels(patches, points)
    pick = joined_motion(patches, groups, np.concatenate(stiffness))
    joined = np.bincount(groups, np.concatenate(stiffness))
    start = row = 0
    for patch, k in zip(patches, stiffness, strict=True):
        block = pick[row : row + points, start : start + len(k)]
        motion = linear_motions(patch)
        whole = (motion * k[:, None]).T @ motion
        few = (block @ motion * joined[row : row + points, None]).T @ (block @ motion)
        np.testing.assert_allclose(few, whole, rtol=1e-9, atol=1e-9 * abs(whole).max())
        start, row = start + len(k), row + points
    # no seat reads the other's motion
    assert pick[:points, len(stiffness[0]) :].max() == 0.0
    np.testing.assert_allclose(pick.sum(axis=1), 1.0, rtol=1e-12)


def test_two_points_stand_where_gauss_puts_them():
    """Along a straight seat of uniform stiffness: at 1 / sqrt(3) of half its length."""
    n = 4000
    line = (np.arange(n) + 0.5) / n - 0.5
    points = np.column_stack([line, np.zeros((n, 2))])
    frame = np.tile(np.eye(3)[[2, 0, 1]], (n, 1, 1))
    patch = Patch("this", points, np.ones(n), frame, np.empty((0, 2), int), np.zeros(n, int))
    pick = joined_motion([patch], (line > 0).astype(int), np.ones(n))
    np.testing.assert_allclose(pick @ line, 0.5 / np.sqrt(3) * np.array([-1, 1]), rtol=1e-6)


def test_a_direction_with_one_point_across_is_left_alone():
    """Nothing but a second point could carry that moment."""
    patch = seat(columns=8)
    groups = element_labels([patch], 2)
    pick = joined_motion([patch], groups, patch.area)
    motion = linear_motions(patch)
    motion[:, 1:] -= np.average(motion[:, 1:], axis=0, weights=patch.area)
    moments = (motion * patch.area[:, None]).T @ motion
    few = (pick @ motion * np.bincount(groups, patch.area)[:, None]).T @ (pick @ motion)
    assert few[0, 0] == pytest.approx(moments[0, 0])
    kept = np.diag(few) / np.diag(moments)
    assert sorted(kept[1:]) == pytest.approx([0.0, 1.0], abs=1e-3)


def test_all_nodes_and_nodes_without_stiffness():
    patch = seat()
    n = len(patch.area)
    np.testing.assert_array_equal(joined_motion([patch], np.arange(n), patch.area), np.eye(n))
    alike = joined_motion([patch], element_labels([patch], 4), np.zeros(n))
    np.testing.assert_allclose(alike.sum(axis=1), 1.0)


def test_elements_of_the_scene_and_elements_joined_from_them_keep_it_too():
    """``contact.points`` first, then the fewer ones of the choice."""
    patch = seat()
    pressed = PressureMap(patch, 1e6 * patch.area, np.zeros(len(patch.area)), 0.0)
    elements, S = friction_elements(
        None, [pressed], replace(Contact(), kt_area=4e10, points=16), 0.8
    )
    motion = np.zeros((len(patch.area), 3, 3))
    motion[:, 0] = linear_motions(patch)
    seen = (S.T @ motion.reshape(-1, 3)).reshape(-1, 3, 3)[:, 0]
    whole = (motion[:, 0] * patch.area[:, None]).T @ motion[:, 0] * 4e10 / 0.8
    few = (seen * elements.kn[:, None]).T @ seen
    np.testing.assert_allclose(few, whole, rtol=1e-9, atol=1e-9 * abs(whole).max())

    groups = element_labels([patch], 4, finest=16)
    pick = joined_motion([element_patch(patch, 16)], groups, elements.kn)
    fewer = (pick @ seen * np.bincount(groups, elements.kn)[:, None]).T @ (pick @ seen)
    np.testing.assert_allclose(fewer, whole, rtol=1e-9, atol=1e-9 * abs(whole).max())


def test_forces_of_the_points_have_the_resultants_of_those_of_the_nodes():
    patch = seat()
    groups = element_labels([patch], 8)
    pick = joined_motion([patch], groups, patch.area)
    motion = linear_motions(patch)
    tilt = np.array([1e-6, 2e-3, -1e-3])
    few = np.bincount(groups, patch.area) * (pick @ motion @ tilt)
    np.testing.assert_allclose(
        motion.T @ (pick.T @ few), motion.T @ (patch.area * (motion @ tilt)), rtol=1e-9
    )


def test_places_of_joined_elements_stay_in_the_seat():
    patch = seat()
    few = element_patch(patch, 4)
    assert few.area.sum() == pytest.approx(patch.area.sum())
    assert len(few.places) == len(few.points) == len(few.area) == 4
    inner = few.points @ patch.frame[0, 1:].T
    outer = patch.points @ patch.frame[0, 1:].T
    assert (inner > outer.min(axis=0)).all() and (inner < outer.max(axis=0)).all()
    assert aggregation_matrix(few, None).shape == (4, 4)
