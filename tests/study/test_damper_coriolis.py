"""What the rotation does to a sector through its damper: against full matrices of both bodies."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh, splu

from bladefem.contact.seating import solve_seating
from bladefem.fem.constraint import at_diameter
from bladefem.hbm.model import Damping
from bladefem.hbm.solve import solve
from bladefem.report.run_messages import damper_spin_messages
from bladefem.scene.toml import load_scene, vary
from bladefem.study.pipeline.assemble_model import joint_model
from bladefem.study.pipeline.bodies import Bodies, rotation_of
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.coriolis import with_coriolis
from bladefem.study.pipeline.damper_contact import seat_damper
from bladefem.study.pipeline.damper_coriolis import damper_spin, with_damper_coriolis
from bladefem.study.pipeline.normal_modes import harmonic_diameters
from bladefem.study.pipeline.ports import blade_ports, damper_ports
from bladefem.study.pipeline.reduced_sector import DamperSpin, reduce_sector, with_damper_mass
from bladefem.study.pipeline.run_records import Seating
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.validate_mesh import found_patches
from bladefem.util.message import by_level

# of the damper over its own mass: a heavy one
HEAVIER = 6.0
# the wave of engine order 27 of 36 sectors runs against the count
DIAMETER = 9


@pytest.fixture(scope="module")
def wedge():
    fields = [
        "mesh.size=20 mm",
        "mesh.scale=2.5",
        "mesh.seat_elements=3",
        "model.modes=20",
        "excitation.engine_order=27",
        "operation.speed=9000 rpm",
    ]
    scene = load_scene("scenes/wedge.toml", fields)
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = found_patches(scene, mesh, excited=True)
    problem = seat_damper(bodies, patches)
    maps = {2e3: solve_seating(problem, scene.operation.speed, normal=2e3, bedded=True)}
    case = load_cases(scene, mesh, Seating(problem, maps))[0]
    reduced = reduce_sector(bodies, patches, harmonic_diameters(scene, mesh, 1), 20)
    return scene, mesh, bodies, patches, case, with_coriolis(scene, reduced)


def in_mesh_numbering(body, A):
    indptr, indices, data = A.getValuesCSR()
    return sp.csr_matrix((data, indices, indptr))[body.scalar_rows][:, body.scalar_rows]


def full_matrices(con):
    """K, M and, for 1 rad/s, Coriolis matrix and spin softening of a constrained body."""
    body, T = con.body, sp.csr_matrix(con.T)
    K, M = (in_mesh_numbering(body, A) for A in (body.K, body.M))
    nodes = sp.identity(M.shape[0] // 3)
    across = sp.kron(nodes, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    perp = sp.kron(nodes, np.diag([1.0, 1.0, 0.0]))
    return [T.conj().T @ A @ T for A in (K, M, 2 * M @ across, M @ perp)]


@pytest.fixture(scope="module")
def stuck(wedge):
    """Squared frequencies of the stuck sector without Coriolis forces, and in its modes the
    matrices of blade and damper, and the softening of the damper.
    """
    scene, mesh, bodies, patches, case, _ = wedge
    blade = at_diameter(bodies.frame, DIAMETER)
    damper = bodies.damper.con
    ours, theirs = full_matrices(blade), full_matrices(damper)
    port = blade_ports(mesh, patches, scene.excitation)
    at_blade = port.matrix[:, port.names["contact"]].T @ sp.csr_matrix(blade.T)
    at_damper = damper_ports(mesh, patches).matrix.T @ sp.csr_matrix(damper.T)
    turn = np.ones(at_blade.shape[0], complex)
    turn[3 * len(patches[0].area) :] = np.exp(2j * np.pi * DIAMETER / scene.disc.sectors)
    relative = case.selection.T @ sp.hstack([sp.diags(turn) @ at_blade, -at_damper])
    e = case.elements
    springs = sp.diags(np.column_stack([e.kn, e.kt, e.kt]).ravel())
    K = sp.block_diag([ours[0], theirs[0]]) + relative.conj().T @ springs @ relative
    M = sp.block_diag([ours[1], HEAVIER * theirs[1]])
    values, X = eigsh(sp.csc_matrix(K, dtype=complex), 12, sp.csc_matrix(M, dtype=complex), -1e4)
    # the conjugate wave: the frame turns the other way
    speed = -rotation_of(bodies).speed
    Xb, Xd = X[: ours[0].shape[0]], X[ours[0].shape[0] :]
    gyro = speed * (Xb.conj().T @ ours[2] @ Xb)
    turning, softening = (HEAVIER * Xd.conj().T @ A @ Xd for A in theirs[2:])
    tangential = np.tile([0.0, 1.0, 1.0], len(e.kt))[:, None]
    moved = np.sqrt(springs.diagonal())[:, None] * tangential * (relative @ X)
    return values, gyro, speed * turning, speed**2 * softening, moved


def waves(stuck, turning=0.0, softer=0.0):
    """Circular frequencies (3,) of the lowest waves, and their tangential contact motion, from the
    Hermitian first-order form; with shares of the damper's Coriolis forces and softening.
    """
    values, blade, damper, softening, moved = stuck
    lam, Q = np.linalg.eigh(np.diag(values) - softer * softening)
    root = np.diag(np.sqrt(lam))
    coupling = Q.conj().T @ (blade + turning * damper) @ Q
    A = np.block([[np.zeros_like(root), root], [root, 1j * coupling]])
    w, vectors = np.linalg.eigh(A)
    upper = Q @ vectors[len(root) :, len(root) :][:, :3]
    return w[len(root) :][:3], np.linalg.norm(
        moved @ (upper / np.linalg.norm(upper, axis=0)), axis=0
    )


@pytest.mark.parametrize("mode", [1, 2])
def test_shift_and_softening_are_those_of_full_matrices(wedge, stuck, mode):
    """6 times as heavy as a damper of steel: modes 1 and 2 move by 0.14 and 0.65 %, and amplitudes
    with friction change by some 4 and 7 %.
    """
    scene, mesh, _, patches, case, reduced = wedge
    heavy = with_damper_mass(reduced, HEAVIER * reduced.mass)
    studied = vary(scene, excitation__mode=mode)
    found = damper_spin(studied, mesh, heavy, patches, case)
    (base, still), (turned, rubbing), (soft, softly) = (
        waves(stuck),
        waves(stuck, turning=1.0),
        waves(stuck, softer=1.0),
    )
    shift, softer = (abs(w / base - 1)[mode - 1] for w in (turned, soft))
    amplitude, of_soft = (abs((still / w) ** 2 - 1)[mode - 1] for w in (rubbing, softly))
    assert found.coriolis == pytest.approx(shift, rel=0.1)
    assert found.coriolis > 1e-3
    assert found.amplitude == pytest.approx(amplitude, rel=0.2)
    assert 0.7 * softer < found.softening < 1.1 * softer
    # in proportion to the frequency it is reported too high, not too low
    assert 0.8 * of_soft < found.softening_amplitude < 2.0 * of_soft


def test_masses_of_the_study_decide(wedge):
    """The heaviest damper is looked at; Coriolis forces of its modes of mass 1 are as before."""
    scene, mesh, _, patches, case, reduced = wedge
    heavy = with_damper_mass(reduced, HEAVIER * reduced.mass)
    studied = vary(scene, study__masses=(0.5 * reduced.mass, HEAVIER * reduced.mass))
    found = damper_spin(studied, mesh, reduced, patches, case)
    assert found == damper_spin(scene, mesh, heavy, patches, case)


@pytest.mark.parametrize("damper", ["rigid", "elastic"])
@pytest.mark.parametrize(
    ("asked", "accuracy", "counted"),
    [(True, 0.1, True), (False, 1e-6, False), (None, 0.1, False), (None, 0.02, True)],
)
def test_the_indicator_decides_as_for_the_blade(wedge, damper, asked, accuracy, counted):
    """It moves mode 1 by 0.02 %, and its amplitude with friction by 0.6 %."""
    scene, mesh, _, patches, case, reduced = wedge
    scene = vary(replace(scene, accuracy=accuracy), operation__coriolis=asked)
    found = with_damper_coriolis(scene, mesh, reduced, patches, case)
    assert 1e-4 < found.damper_spin.coriolis < 4e-4
    assert 4e-3 < found.damper_spin.amplitude < 8e-3
    assert (found.damper.damping is not None) == counted
    model = joint_model(scene, mesh, found, patches, case, 1, damper)
    coupling = model.damper.gyroscopic if damper == "rigid" else model.damper[0].damping
    assert (coupling is not None) == counted


def sticking_response(wedge, engine_order, omega):
    """Probe of the sector in full stick without losses, by the matrices of both bodies."""
    scene, mesh, bodies, patches, case, _ = wedge
    blade, damper = at_diameter(bodies.frame, DIAMETER), bodies.damper.con
    speed = rotation_of(bodies).speed
    K, M, G, _ = full_matrices(blade)
    Kd, Md, Gd, _ = (HEAVIER * A for A in full_matrices(damper))
    port = blade_ports(mesh, patches, scene.excitation)
    rows = (port.matrix.T @ sp.csr_matrix(blade.T)).tocsr()
    if engine_order != DIAMETER:
        # the wave that runs against the count
        K, M, G, rows = (A.conj() for A in (K, M, G, rows))
    contact, load, probe = (rows[port.names[name]] for name in ("contact", "load", "probe"))
    turn = np.ones(contact.shape[0], complex)
    turn[3 * len(patches[0].area) :] = np.exp(2j * np.pi * engine_order / scene.disc.sectors)
    at_damper = damper_ports(mesh, patches).matrix.T @ sp.csr_matrix(damper.T)
    relative = case.selection.T @ sp.hstack([sp.diags(turn) @ contact, -at_damper])
    e = case.elements
    springs = sp.diags(np.column_stack([e.kn, e.kt, e.kt]).ravel())
    elastic = sp.block_diag([K, Kd / HEAVIER]) + relative.conj().T @ springs @ relative
    coriolis = speed * sp.block_diag([G, Gd])
    Z = elastic - omega**2 * sp.block_diag([M, Md]) + 1j * omega * coriolis
    force = np.zeros(Z.shape[0], complex)
    force[: K.shape[0]] = (load.conj().T @ np.atleast_1d(scene.excitation.force)).ravel()
    return (probe @ splu(sp.csc_matrix(Z)).solve(force)[: K.shape[0]])[0]


@pytest.mark.parametrize(("engine_order", "raises"), [(27, False), (9, True)])
def test_both_waves_respond_as_by_full_matrices(wedge, engine_order, raises):
    """The damper's Coriolis forces lower the response of one wave and raise that of the other."""
    scene, mesh, _, patches, case, reduced = wedge
    omega = 2 * np.pi * 400.0
    scene = vary(scene, excitation__engine_order=engine_order, operation__coriolis=True)
    gripping = replace(case, elements=replace(case.elements, mu=1e5 + 0 * case.elements.mu))
    heavy = with_damper_mass(with_coriolis(scene, reduced), HEAVIER * reduced.mass)
    found = []
    for one in (heavy, with_damper_coriolis(scene, mesh, heavy, patches, case)):
        model = joint_model(scene, mesh, one, patches, gripping, 1, "rigid")
        lossless = replace(model, damping=Damping(), damper_damping=Damping())
        found.append(solve(lossless, omega, 1, 64).probe[1, 0])
    change = (found[1] / found[0] - 1).real
    assert change > 4e-3 if raises else change < -4e-3
    assert found[1] == pytest.approx(sticking_response(wedge, engine_order, omega), rel=5e-4)


def test_a_damper_that_is_a_mass_has_none(wedge):
    """They push it up and down the slope, where the paper's damper does not go."""
    scene, mesh, _, patches, case, reduced = wedge
    scene = vary(scene, model__damper="mass", operation__coriolis=True)
    found = with_damper_coriolis(scene, mesh, reduced, patches, case)
    assert found.damper.damping is None
    assert found.damper_spin.coriolis == found.damper_spin.amplitude == 0.0
    said = damper_spin_messages(SimpleNamespace(scene=scene, reduced=found))
    assert not [text for text in said if "Coriolis" in text]
    assert damper_spin_messages(SimpleNamespace(scene=replace(scene, accuracy=1e-6), reduced=found))


@pytest.mark.parametrize(
    ("coriolis", "softening", "damping", "words"),
    [
        (1e-4, 1e-5, None, ["0.01 %.*left out of the responses"]),
        (0.02, 1e-4, np.eye(2), ["2 %.*responses have them"]),
        (0.02, 0.004, None, ["2 %.*by operation.coriolis = false", "softening.*0.4 %"]),
    ],
)
def test_what_is_said_of_it(coriolis, softening, damping, words):
    found = SimpleNamespace(
        scene=SimpleNamespace(accuracy=0.02, excitation=SimpleNamespace(mode=1)),
        reduced=SimpleNamespace(
            damper=SimpleNamespace(damping=damping),
            damper_spin=DamperSpin(coriolis, 0.0, softening, 0.0),
        ),
    )
    said = damper_spin_messages(found)
    assert len(said) == len(words)
    for text, wanted in zip(said, words, strict=True):
        assert re.search(wanted, text)
    assert all(text.advice for text in by_level(said)["warning"])
