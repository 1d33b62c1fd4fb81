"""Bodies from matrices: the receptance of the reduced body is that of the matrices."""

import numpy as np
import pytest
from scipy import io, linalg
from scipy.linalg import block_diag

from bladefem.data import PortModel
from bladefem.errors import InputError
from bladefem.reduction.assemble import (
    folded_diameter,
    join_bodies,
    pair_models,
    recombine_contact,
    wheel_models,
)
from bladefem.reduction.beam import beam_matrices, reference_blade
from bladefem.reduction.matrices import port_model_from_matrices, read_matrices
from bladefem.reduction.truncate import truncate_modes


def receptance(body, w):
    damping = np.zeros(1) if body.damping is None else body.damping
    Z = np.diag(body.omega**2 - w**2) + 1j * w * (
        np.diag(damping) if damping.ndim == 1 else damping
    )
    if body.circulatory is not None:
        Z = Z + body.circulatory
    return body.shapes @ np.linalg.solve(Z, body.shapes.conj().T) + body.residual


def test_cantilever_frequencies():
    """Uniform beam: (1.875104, 4.694091, 7.854757)^2 sqrt(EI / (rho A)) / L^2 (Blevins 1979)."""
    K, M = beam_matrices(elements=40)
    exact = (
        np.array([1.87510407, 4.69409113, 7.85475744]) ** 2
        * np.sqrt(2.1e11 * 0.006**2 / 12 / 7850)
        / 0.15**2
    )
    np.testing.assert_allclose(np.sqrt(linalg.eigvalsh(K, M)[:3]), exact, rtol=2e-6)


def test_reference_blade_frequencies():
    np.testing.assert_allclose(reference_blade().omega[:2] / 2 / np.pi, [220.86, 1236.6], rtol=5e-5)


def test_receptance_of_all_modes_is_exact_and_residual_flexibility_makes_truncation_static_exact():
    rng = np.random.default_rng(1)
    K, M = beam_matrices()
    C = 1e-5 * K + np.diag(rng.uniform(1, 2, len(K)))
    ports = {"contact": np.array([10, 12]), "probe": rng.normal(size=(1, len(K)))}
    P = np.vstack([np.eye(len(K))[ports["contact"]], ports["probe"]])
    full = port_model_from_matrices(M, K, ports, C=C)
    w = 2 * np.pi * 900
    exact = P @ np.linalg.solve(K - w**2 * M + 1j * w * C, P.T)
    np.testing.assert_allclose(receptance(full, w), exact, rtol=0, atol=1e-10 * abs(exact).max())
    few = port_model_from_matrices(M, K, ports, count=3)
    np.testing.assert_allclose(receptance(few, 0.0), P @ np.linalg.solve(K, P.T), rtol=1e-8)


@pytest.mark.parametrize(
    "C", [None, 1e-5, np.diag(np.arange(40.0))], ids=["none", "proportional", "coupling modes"]
)
def test_modes_left_out_later_are_those_left_out_at_once(C):
    K, M = beam_matrices()
    ports = {"contact": np.array([10, 12]), "probe": np.array([38])}
    C = C * K if isinstance(C, float) else C
    cut = truncate_modes(port_model_from_matrices(M, K, ports, C=C), 4)
    once = port_model_from_matrices(M, K, ports, C=C, count=4)
    np.testing.assert_allclose(receptance(cut, 3000.0), receptance(once, 3000.0), rtol=1e-9)


def test_proportional_damping_stays_diagonal():
    K, M = beam_matrices()
    body = port_model_from_matrices(M, K, {"contact": np.array([0])}, C=1e-6 * K + 2.0 * M)
    np.testing.assert_allclose(body.damping, 1e-6 * body.omega**2 + 2.0, rtol=1e-6)


def test_free_body_has_rigid_modes():
    K = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    body = port_model_from_matrices(np.eye(2), K, {"contact": np.array([0])})
    assert body.omega[0] == 0 and body.omega[1] == pytest.approx(np.sqrt(2e6))


@pytest.mark.parametrize("elements", [80, 200, 400])
def test_a_fine_slender_beam_is_not_taken_for_a_floating_one(elements):
    """The spectrum spans more than ten digits; frequencies after Blevins, tip flexibility L^3 / (3
    E I).
    """
    K, M = beam_matrices(elements=elements)
    body = port_model_from_matrices(M, K, {"contact": np.array([2 * elements - 2])}, count=6)
    exact = (
        np.array([1.87510407, 4.69409113, 7.85475744]) ** 2
        * np.sqrt(2.1e11 * 0.006**2 / 12 / 7850)
        / 0.15**2
    )
    np.testing.assert_allclose(body.omega[:3], exact, rtol=1e-6)
    tip = 0.15**3 / (3 * 2.1e11 * 0.03 * 0.006**3 / 12)
    np.testing.assert_allclose(receptance(body, 0.0), [[tip]], rtol=1e-6)


def test_a_light_mass_leaves_the_frequency_of_the_heavy_one():
    """1 kg on two springs in series of 1e6 N/m, with 1e-11 kg between them: 0.5e6 / s^2."""
    K = np.array([[1e6, -1e6], [-1e6, 2e6]])
    body = port_model_from_matrices(np.diag([1.0, 1e-11]), K, {"contact": np.arange(2)}, count=1)
    np.testing.assert_allclose(body.omega**2, 0.5e6, rtol=1e-9)
    with pytest.raises(InputError, match="semidefinite"):
        port_model_from_matrices(
            np.diag([1.0, 1e-11]), K - np.diag([0.6e6, 0]), {"contact": np.arange(2)}
        )


@pytest.mark.parametrize("digits", ["double", "ten", "single"])
def test_a_fine_free_beam_has_two_rigid_modes(digits):
    """The others are those of Blevins: (4.7300407, 7.8532046)^2 sqrt(EI / (rho A)) / L^2."""
    n = 100
    K, M = free_beam(n)
    if digits == "single":
        K, M = (A.astype(np.float32) for A in (K, M))
    elif digits == "ten":
        K, M = (np.vectorize(lambda value: float(f"{value:.9e}"))(A) for A in (K, M))
    body = port_model_from_matrices(M, K, {"contact": np.array([2 * n])}, count=6)
    np.testing.assert_array_equal(body.omega[:2], 0.0)
    exact = (
        np.array([4.73004074, 7.85320462]) ** 2 * np.sqrt(2.1e11 * 0.006**2 / 12 / 7850) / 0.15**2
    )
    np.testing.assert_allclose(body.omega[2:4], exact, rtol=1e-2 if digits == "single" else 1e-6)


def free_beam(elements):
    """The reference beam without its clamp: the first element's own matrices complete the rest."""
    K, M = (np.zeros((2 * elements + 2,) * 2) for _ in range(2))
    whole = (np.zeros((4, 4)), np.zeros((4, 4)))
    tip = beam_matrices(elements=1, length=0.15 / elements)
    turn = np.diag([1.0, -1.0])
    for out, own, many in zip(
        whole, tip, beam_matrices(elements=2, length=0.3 / elements), strict=True
    ):
        out[2:, 2:] = own
        out[:2, :2] = turn @ own @ turn
        out[:2, 2:] = many[:2, 2:]
        out[2:, :2] = many[2:, :2]
    for e in range(elements):
        K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += whole[0]
        M[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += whole[1]
    return K, M


def test_matrices_are_read_from_npz_mat_and_mtx(tmp_path):
    K, M = beam_matrices(elements=2)
    np.savez(tmp_path / "a.npz", K=K, M=M)
    io.savemat(tmp_path / "a.mat", {"K": K, "M": M})
    io.mmwrite(tmp_path / "K.mtx", K)
    for name in ("a.npz", "a.mat", "K.mtx"):
        np.testing.assert_allclose(read_matrices(tmp_path / name)["K"], K, rtol=1e-14)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"count": 99}, "count"),
        ({"M": -np.eye(4)}, "M"),
        ({"K": np.ones((4, 3))}, "K"),
        ({"ports": {"load": np.array([9])}}, "load"),
    ],
)
def test_bad_matrices(change, word):
    K, M = beam_matrices(elements=2)
    with pytest.raises(InputError, match=word):
        port_model_from_matrices(**{"M": M, "K": K, "ports": {"contact": np.array([0])}} | change)


def test_nodal_diameters():
    assert [folded_diameter(h, 5, 12) for h in range(4)] == [
        (0, False),
        (5, False),
        (2, True),
        (3, False),
    ]


def test_the_wheel_sees_the_next_blade_turned():
    """Against the ring of N blades coupled by springs written out in full: exact in every nodal
    diameter.
    """
    N, EO, k = 6, 2, 3e5
    body = reference_blade(1, modes=4)
    pair = wheel_models({n: body for n in range(4)}, slice(1, 2), EO, N, 3)[1]
    w = 2 * np.pi * 300
    R = receptance(body, w)
    contact, load = R[:1, :1], R[:1, 2:3]
    wheel_R, B = (
        np.kron(np.eye(N), contact),
        np.roll(np.eye(N), -1, axis=0),
    )  # B x: the next blade's x
    spring = (np.eye(N) - B).T @ (np.eye(N) - B) * k
    force = np.exp(2j * np.pi * EO / N * np.arange(N))
    free = np.kron(np.eye(N), load) @ force
    wheel = np.linalg.solve(np.eye(N) + wheel_R @ spring, free)
    P = receptance(pair, w)
    relative = np.array([[1.0, -1.0]]) @ P[:2]  # a spring between this and the next
    relative = np.linalg.solve(
        1 + k * relative[:, :2] @ np.array([[1.0], [-1.0]]), relative[:, 2:3]
    )
    np.testing.assert_allclose(relative[0, 0], (wheel[0] - wheel[1]), rtol=1e-10)


def test_in_antiphase_and_in_phase_models_stay_real():
    models = pair_models(reference_blade(2), slice(2, 4), np.pi, 3)
    assert all(np.isrealobj(m.shapes) for m in models)
    assert (
        models[1].shapes[2, 0] == -models[1].shapes[0, 0]
        and models[2].shapes[2, 0] == models[2].shapes[0, 0]
    )


def test_two_bodies_as_one_with_relative_contact():
    one = reference_blade(1, modes=3)
    both = recombine_contact(join_bodies((one, one)), np.array([[1.0, 0.0, -1.0, 0.0]]))
    R, S = receptance(one, 1000.0), receptance(both, 1000.0)
    assert both.ports == {"contact": slice(0, 1), "load": slice(1, 3), "probe": slice(3, 5)}
    np.testing.assert_allclose(S[0, 0], 2 * R[0, 0], rtol=1e-12)
    np.testing.assert_allclose(S[0, 1:3], [R[0, 2], -R[0, 2]], rtol=1e-12)


def chain(dofs=5, ground=0.0):
    """Unit masses on unit springs, held at the first one by a spring to the ground."""
    K = 2 * np.eye(dofs) - np.eye(dofs, k=1) - np.eye(dofs, k=-1)
    K[0, 0] = 1.0 + ground
    K[-1, -1] = 1.0
    return K


def test_stiffness_proportional_damping_leaves_the_rigid_motion_of_a_free_body_undamped():
    """Its modal damping is rounding of either sign, which was refused as negative."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        M = np.diag(rng.uniform(0.1, 3.0, 5))
        K = 1e6 * rng.uniform(0.5, 2.0) * chain()
        body = port_model_from_matrices(M, K, {"contact": [0], "probe": [4]}, C=1e-6 * K)
        assert body.omega[0] == 0.0
        assert body.damping.ndim == 1
        assert 0.0 <= body.damping[0] < 1e-12 * body.damping[-1]


def test_a_gyroscopic_matrix_is_part_of_the_receptance():
    rng = np.random.default_rng(4)
    K = chain(ground=1.0)
    turn = rng.normal(size=K.shape)
    C = 0.02 * K + 0.3 * (turn - turn.T)
    body = port_model_from_matrices(np.eye(5), K, {"contact": [0, 2], "probe": [4]}, C=C)
    P = np.eye(5)[[0, 2, 4]]
    for w in (0.5, 1.3):
        exact = P @ np.linalg.solve(K - w**2 * np.eye(5) + 1j * w * C, P.T)
        assert abs(exact - exact.T).max() > 0.05 * abs(exact).max()
        np.testing.assert_allclose(receptance(body, w), exact, rtol=0, atol=1e-11)


def test_motions_without_mass_follow_statically():
    """The receptance is that of all degrees of freedom, the massless ones with a port included."""
    K = chain(ground=1.0)
    M = np.diag([1.0, 0.0, 2.0, 1.0, 0.0])
    body = port_model_from_matrices(M, K, {"contact": [0, 1], "probe": [4]}, C=0.0 * K)
    P = np.eye(5)[[0, 1, 4]]
    assert len(body.omega) == 3
    for w in (0.0, 0.4, 1.7):
        exact = P @ np.linalg.solve(K - w**2 * M, P.T)
        np.testing.assert_allclose(receptance(body, w), exact, rtol=0, atol=1e-11)


def test_unsymmetric_stiffness_is_part_of_the_receptance():
    """At rest as well; of all modes, and of a body joined of two."""
    rng = np.random.default_rng(5)
    turn = rng.normal(size=(5, 5))
    K = chain(ground=1.0) + 0.2 * (turn - turn.T)
    C = 0.02 * chain(ground=1.0)
    body = port_model_from_matrices(
        np.eye(5), K, {"contact": [0, 2], "probe": [4]}, C=C, unsymmetric=True
    )
    P = np.eye(5)[[0, 2, 4]]
    for w in (0.0, 0.5, 1.3):
        exact = P @ np.linalg.solve(K - w**2 * np.eye(5) + 1j * w * C, P.T)
        assert abs(exact - exact.T).max() > 0.02 * abs(exact).max()
        np.testing.assert_allclose(receptance(body, w), exact, rtol=0, atol=1e-11)
        twice = receptance(join_bodies((body, body)), w)
        np.testing.assert_allclose(twice[:2, :2], exact[:2, :2], rtol=0, atol=1e-11)
        np.testing.assert_allclose(twice[2:4, 2:4], exact[:2, :2], rtol=0, atol=1e-11)
    assert truncate_modes(body, 3).circulatory.shape == (3, 3)


def test_unsymmetric_stiffness_is_asked_for_and_leaves_rigid_and_massless_motions_alone():
    skew = np.zeros((5, 5))
    skew[2, 3], skew[3, 2] = 0.3, -0.3
    ports = {"contact": [0, 1], "probe": [4]}
    with pytest.raises(InputError, match="unsymmetric = True"):
        port_model_from_matrices(np.eye(5), chain(ground=1.0) + skew, ports)
    with pytest.raises(InputError, match="rigid motion"):
        port_model_from_matrices(np.eye(5), chain() + skew, ports, unsymmetric=True)
    K = chain(ground=1.0) + skew
    with pytest.raises(InputError, match="without mass"):
        port_model_from_matrices(np.diag([1.0, 1, 0, 1, 1]), K, ports, unsymmetric=True)
    M = np.diag([1.0, 0.0, 2.0, 1.0, 0.0])
    body = port_model_from_matrices(M, K, ports, unsymmetric=True)
    P = np.eye(5)[[0, 1, 4]]
    for w in (0.0, 0.4, 1.7):
        exact = P @ np.linalg.solve(K - w**2 * M, P.T)
        np.testing.assert_allclose(receptance(body, w), exact, rtol=0, atol=1e-11)
    symmetric = port_model_from_matrices(M, chain(ground=1.0), ports, unsymmetric=True)
    assert symmetric.circulatory is None


@pytest.mark.parametrize("turn", [1.0, np.exp(0.7j)])
def test_other_contacts_are_a_congruence(turn):
    """Real and complex bodies, contact before and after another port."""
    draw = np.random.default_rng(3).standard_normal
    phase = np.array([1, turn, turn, 1, 1])
    half = draw((5, 5))
    body = PortModel(
        np.arange(1.0, 4.0),
        phase[:, None] * draw((5, 3)),
        phase[:, None] * (half @ half.T) * phase.conj(),
        {"load": slice(0, 1), "contact": slice(1, 4), "probe": slice(4, 5)},
        static_offset=draw(5),
    )
    selection = draw((2, 3))
    T = block_diag(1.0, selection, 1.0)
    other = recombine_contact(body, selection)
    assert other.ports == {"load": slice(0, 1), "contact": slice(1, 3), "probe": slice(3, 4)}
    np.testing.assert_allclose(other.shapes, T @ body.shapes, rtol=1e-13)
    np.testing.assert_allclose(other.residual, T @ body.residual @ T.T, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(other.static_offset, T @ body.static_offset, rtol=1e-13)
