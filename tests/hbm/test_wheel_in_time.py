"""The shipped wheel in time: four free blades with their dampers, integrated by code of its own.

Engine order 9 of 36 sectors repeats after four blades. The finite elements are reduced to their
modes (without residual flexibility, which has no inertia); in the nodal diameters 0, 9, 18 and 27
they are a ring of four blades in which any of the blades may move as it likes, so a travelling wave
that is not stable does not stay. The march is that of benchmarks/loads_in_time.py: small explicit
steps, a return map of its own, nothing prescribed.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.contact.seating import solve_seating as seat
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.reduction.truncate import truncate_modes
from bladefem.scene.toml import load_scene
from bladefem.study.pipeline.assemble_model import joint_model
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.damper_contact import seat_damper
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.run_records import Seating
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.validate_mesh import found_patches

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from loads_in_time import layer_of, march, ring_of, start_at_rest

MODES = 12
STEPS = 1000
PERIODS = 160


@pytest.fixture(scope="module")
def wheel():
    """The wedge scene on a coarse mesh, by its modes alone."""
    # with the fillet the wave at this mesh is still not steady after 180 periods
    scene = load_scene(
        "scenes/wedge.toml",
        ["mesh.size=14 mm", "mesh.seat_elements=4", "aerofoil.fillet=0 mm"],
    )
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = found_patches(scene, mesh, excited=True)
    problem = seat_damper(bodies, patches)
    reduced = reduce_sector(bodies, patches, [0, 9, 18], 2 * MODES)
    sector = {
        n: without_residual(truncate_modes(body, MODES)) for n, body in reduced.sector.items()
    }
    reduced = replace(reduced, sector=sector, damper=without_residual(reduced.damper))
    return SimpleNamespace(
        scene=scene, mesh=mesh, patches=patches, problem=problem, reduced=reduced
    )


def without_residual(body):
    return replace(body, residual=np.zeros_like(body.residual))


@pytest.mark.parametrize(("load", "harmonics"), [(80.0, 31), (640.0, 15)])
def test_balance_agrees_with_the_free_ring_in_time(wheel, load, harmonics):
    scene = wheel.scene
    maps = {load: seat(wheel.problem, scene.operation.speed, normal=load, bedded=True)}
    case = load_cases(scene, wheel.mesh, Seating(wheel.problem, maps))[0]
    model = joint_model(scene, wheel.mesh, wheel.reduced, wheel.patches, case, harmonics, "elastic")
    free = wheel.reduced.sector[9].omega[0]
    # near the peak: on a flank under 640 N a quarter of the nodes never slip, and what the way there
    # leaves in them moves the amplitude by 1 %
    curve = [solve(model, free * x, 3, 128) for x in np.linspace(1.03, 1.07, 9)]
    highest = max((p for p in curve if p.converged), key=lambda p: abs(p.probe[1, 0]))
    # where every node slips the tangential forces turn fast: 15 harmonics are 0.4 % off
    top = solve(model, highest.omega, harmonics, 512, start=highest)
    assert top.converged
    nodes = len(case.elements.kt)
    layer = layer_of(case)
    ring = ring_of(scene, wheel.reduced, wheel.reduced.following.start)
    state = start_at_rest(ring, layer)
    heights = []
    places = []
    for _ in range(PERIODS):
        heights.append(march(ring, layer, state, top.frequency, STEPS))
        places.append(state.p @ ring.damper.T)
    assert heights[-1] == pytest.approx(heights[-5], rel=1e-3), "not steady"
    # all four blades, each with its own phase
    assert heights[-1] == pytest.approx(np.full(ring.blades, size(top)), rel=5e-3)
    # the step that each damper makes in a period, at the contact that moves most
    step = (places[-1] - places[-2]).reshape(ring.blades, nodes, 3)
    speed = np.linalg.norm(step, axis=2).max(axis=1) * top.omega / (2 * np.pi)
    # amplitudes and phases that still change move the places: no walk is told from less than that
    unsteady = 3 * np.abs(heights[-1] - heights[-2]).max() * top.omega / (2 * np.pi)
    assert speed == pytest.approx(np.full(ring.blades, top.drift), rel=0.05, abs=unsteady)
    assert unsteady < 3e-5
