"""The shipped wheel in time: four free blades with their dampers, integrated by code of its own.

Engine order 9 of 36 sectors repeats after four blades. The finite elements are reduced to their
modes (without residual flexibility, which has no inertia); in the nodal diameters 0, 9, 18 and 27
they are a ring of four blades in which any of the blades may move as it likes, so a travelling wave
that is not stable does not stay. Small explicit steps, a return map written here, nothing prescribed.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from bladefem.contact.seating import solve_seating as seat
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

BLADES = 4
MODES = 12
STEPS = 1000
PERIODS = 120


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


@njit
def return_map(w, old, f, kt, kn, mu, n0):
    """Forces beyond the preload on the damper at one contact node; f holds the slider's forces."""
    before = max(n0, 0.0)
    normal = max(n0 + kn * w[0], 0.0)
    a = f[0] + kt * (w[1] - old[1])
    b = f[1] + kt * (w[2] - old[2])
    size = np.sqrt(a * a + b * b)
    limit = mu * normal
    if size > limit:
        a *= limit / size
        b *= limit / size
    f[0] = a
    f[1] = b
    return normal - before, a, b


@njit
def march(shapes, omega, zeta, loads, dampers, contact, state, drive, steps):
    """Symplectic Euler steps of the modes of the ring and of the dampers; returns the
    probe of each blade.

    shapes (modes, blades ports) and dampers (modes, ports) give displacements from modal
    coordinates; forces act through the same.
    """
    q, v, p, z, slider, old = state
    w_blade, w_damper, zeta_damper = omega
    kt, kn, mu, n0 = contact
    blades = slider.shape[0]
    nodes = kt.size
    half = nodes * 3
    dt = drive[1]
    out = np.zeros((steps, blades))
    force = np.zeros((blades, half))
    w = np.zeros(3)
    for i in range(steps):
        t = drive[2] + i * dt
        for b in range(blades):
            after = (b + 1) % blades
            for k in range(nodes):
                # the first seats touch this blade, the others the next one
                blade = b if k < drive[3] else after
                for d in range(3):
                    row = 3 * k + d
                    w[d] = shapes_times(shapes, q, blade, row) - row_times(dampers, p[b], row)
                n, a, c = return_map(w, old[b, k], slider[b, k], kt[k], kn[k], mu[k], n0[k])
                old[b, k] = w
                force[b, 3 * k] = n
                force[b, 3 * k + 1] = a
                force[b, 3 * k + 2] = c
        for m in range(q.size):
            push = 0.0
            for b in range(blades):
                push += loads[m, b, 0] * np.cos(drive[0] * t + b * drive[4])
                before = (b - 1) % blades
                for row in range(half):
                    owner = b if row < 3 * drive[3] else before
                    push -= shapes[m, b, row] * force[owner, row]
            v[m] += dt * (push - w_blade[m] ** 2 * q[m] - 2 * zeta * w_blade[m] * v[m])
        for b in range(blades):
            for m in range(p.shape[1]):
                push = 0.0
                for row in range(half):
                    push += dampers[m, row] * force[b, row]
                z[b, m] += dt * (
                    push - w_damper[m] ** 2 * p[b, m] - 2 * zeta_damper * w_damper[m] * z[b, m]
                )
        q += dt * v
        p += dt * z
        for b in range(blades):
            total = 0.0
            for m in range(q.size):
                total += loads[m, b, 1] * q[m]
            out[i, b] = total
    return out


@njit
def shapes_times(shapes, q, blade, row):
    total = 0.0
    for m in range(q.size):
        total += shapes[m, blade, row] * q[m]
    return total


@njit
def row_times(dampers, p, row):
    total = 0.0
    for m in range(p.size):
        total += dampers[m, row] * p[m]
    return total


def ring(reduced):
    """Real, mass-normalised modes of the ring: frequencies (m,), ports (m, blades, ports)."""
    omega, shapes = [], []
    for n, body in reduced.sector.items():
        turn = np.exp(2j * np.pi * n * np.arange(BLADES) / 36)
        waves = turn[None, :, None] * body.shapes.T[:, None, :]
        if n in (0, 18):
            parts = [waves.real / np.sqrt(BLADES)]
        else:
            parts = [waves.real * np.sqrt(2 / BLADES), -waves.imag * np.sqrt(2 / BLADES)]
        for part in parts:
            omega.append(body.omega)
            shapes.append(part)
    return np.concatenate(omega), np.concatenate(shapes)


@pytest.mark.parametrize(("load", "harmonics"), [(80.0, 31), (640.0, 15)])
def test_balance_agrees_with_the_free_ring_in_time(wheel, load, harmonics):
    scene = wheel.scene
    maps = {load: seat(wheel.problem, scene.operation.speed, normal=load, bedded=True)}
    case = load_cases(scene, wheel.mesh, Seating(wheel.problem, maps))[0]
    model = joint_model(scene, wheel.mesh, wheel.reduced, wheel.patches, case, harmonics, "elastic")
    free = wheel.reduced.sector[9].omega[0]
    curve = [solve(model, free * x, 3, 128) for x in np.linspace(1.03, 1.07, 5)]
    highest = max((p for p in curve if p.converged), key=lambda p: abs(p.probe[1, 0]))
    # where every node slips the tangential forces turn fast: 15 harmonics are 0.4 % off
    top = solve(model, highest.omega, harmonics, 512, start=highest)
    assert top.converged
    omega, shapes = ring(wheel.reduced)
    body = next(iter(wheel.reduced.sector.values()))
    force = scene.excitation.force * shapes[:, :, body.ports["load"]]
    loads = np.concatenate([force, shapes[:, :, body.ports["probe"]]], axis=2)
    damper = wheel.reduced.damper
    e = case.elements
    first = len(wheel.patches[0].area)
    dt = 2 * np.pi / top.omega / STEPS
    nodes = len(e.kt)
    slips = damper.shapes[damper.ports["contact"]].T
    state = (
        np.zeros(len(omega)),
        np.zeros(len(omega)),
        np.zeros((BLADES, len(slips))),
        np.zeros((BLADES, len(slips))),
        np.zeros((BLADES, nodes, 2)),
        np.zeros((BLADES, nodes, 3)),
    )
    drive = np.array([top.omega, dt, 0.0, first, 2 * np.pi * 9 / 36])
    contact = tuple(np.broadcast_to(x, nodes).astype(float) for x in (e.kt, e.kn, e.mu, e.n0))
    zeta = scene.operation.damping
    heights = []
    places = []
    for _ in range(PERIODS):
        x = march(
            np.ascontiguousarray(shapes[:, :, body.ports["contact"]]),
            (omega, damper.omega, zeta),
            zeta,
            loads,
            np.ascontiguousarray(slips),
            contact,
            state,
            drive,
            STEPS,
        )
        drive[2] += STEPS * dt
        angle = top.omega * (drive[2] - STEPS * dt + dt * np.arange(1, STEPS + 1))
        places.append(state[2] @ slips)
        heights.append(2 * abs(np.mean(x * np.exp(-1j * angle)[:, None], axis=0)))
    assert heights[-1] == pytest.approx(heights[-5], rel=1e-3), "not steady"
    # all four blades, each with its own phase
    assert heights[-1] == pytest.approx(np.full(BLADES, abs(top.probe[1, 0])), rel=5e-3)
    # the step that each damper makes in a period, at the contact that moves most
    step = (places[-1] - places[-2]).reshape(BLADES, nodes, 3)
    speed = np.linalg.norm(step, axis=2).max(axis=1) * top.omega / (2 * np.pi)
    # amplitudes and phases that still change move the places: no walk is told from less than that
    unsteady = 3 * np.abs(heights[-1] - heights[-2]).max() * top.omega / (2 * np.pi)
    assert speed == pytest.approx(np.full(BLADES, top.drift), rel=0.05, abs=unsteady)
    assert unsteady < 3e-5
