"""Forced response of one sector against a direct solve of the whole wheel, with each kind of
damping.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from wheels import bodies

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.stress import gauss_and_nodal_stress, nodal_stress, von_mises
from bladefem.hbm.model import Damping
from bladefem.scene.tables import Material
from bladefem.study.modes.linear_response import (
    displacement_at,
    excitation_load,
    find_linear_peak,
    half_widths,
    linear_response,
    pressure_load,
    probe_response,
    static_offset,
)
from bladefem.study.modes.linear_response_report import (
    forced_response_answer,
    read_damping,
    read_loads,
    stress_states,
    stress_table,
)
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import wheel_modes
from geometry.mesh import Mesh

COUNT, SMALL = 5, (2, 1, 1)


def wheel_matrices(mesh):
    """Dense K and M of the full wheel, free rows, and the (sectors, n) numbers of each sector's
    nodes.
    """
    count, pairs, n = mesh.sector.count, mesh.pairs["cyclic"].nodes, len(mesh.points)
    number = np.arange(count * n).reshape(count, n)
    for s in range(count):
        number[(s + 1) % count, pairs[0]] = number[s, pairs[1]]
    number[0, pairs[0]] = number[count - 1, pairs[1]]
    used, dense = np.unique(number, return_inverse=True)
    dense = dense.reshape(number.shape)
    points = np.empty((len(used), 3))
    for s in range(count):
        points[dense[s]] = mesh.points @ np.linalg.matrix_power(mesh.sector.rotation, s).T
    clamp = np.concatenate([dense[s][mesh.faces["clamp"]] for s in range(count)])
    whole = Mesh(
        points, mesh.cell_type, {"blade": np.concatenate([d[mesh.bodies["blade"]] for d in dense])}
    )
    body = assemble(whole, "blade", Material())
    rows = body.scalar_rows
    free = np.setdiff1d(
        np.arange(3 * len(points)), (3 * np.unique(clamp)[:, None] + np.arange(3)).ravel()
    )
    K, M = (A[:, :][np.ix_(rows, rows)] for A in (body.K, body.M))
    return K, M, free, dense


def whole_wheel(one, load, order, frequency, damping):
    """Displacement of blade 0 when each blade's load is turned and shifted in phase."""
    mesh = one.mesh
    K, M, free, dense = wheel_matrices(mesh)
    force = np.zeros((len(K) // 3, 3), complex)
    for s in range(mesh.sector.count):
        R = np.linalg.matrix_power(mesh.sector.rotation, s)
        np.add.at(
            force,
            dense[s],
            np.exp(2j * np.pi * order * s / mesh.sector.count) * load.reshape(-1, 3) @ R.T,
        )
    w = 2 * np.pi * frequency
    Z = (
        K * (1 + 1j * damping.structural)
        - w**2 * M
        + 1j * w * (damping.mass * M + damping.stiffness * K)
    )
    u = np.zeros(len(K), complex)
    u[free] = np.linalg.solve(Z[np.ix_(free, free)], force.ravel()[free])
    return u.reshape(-1, 3)[dense[0]]


@pytest.mark.parametrize("order", [0, 1, 3, 4, 7])
@pytest.mark.parametrize("damping", [Damping(structural=0.01), Damping(mass=20.0, stiffness=1e-7)])
def test_sector_answers_as_the_whole_wheel(order, damping):
    """Every kind of wave: standing, with and against the count. The modes left out answer
    statically: 1e-4.
    """
    one = bodies(order=order, count=COUNT, divisions=SMALL)
    load = excitation_load(one).astype(complex) + pressure_load(one, "tip", 50.0 + 20.0j)
    response = linear_response(one, load, damping, modes=25)
    for frequency in (0.0, 0.97 * response.omega[0] / (2 * np.pi)):
        exact = whole_wheel(one, load, order, frequency, damping)
        if frequency == 0.0 and damping.structural:
            continue  # a loss factor means nothing at rest
        np.testing.assert_allclose(
            displacement_at(response, frequency), exact, atol=1e-4 * abs(exact).max()
        )


def test_resonance_of_a_single_mode():
    """phi^2 F / (2 zeta omega^2) with the modal damping of the scene; the phase turns by a
    quarter.
    """
    one = bodies(order=2)
    response = linear_response(one)
    vector = excitation_load(one) / one.scene.excitation.force
    f, amplitude = find_linear_peak(response, vector)
    alone = (
        abs(response.modal_load[0]) ** 2
        / one.scene.excitation.force
        / (2 * 0.002 * response.omega[0] ** 2)
    )
    assert amplitude == pytest.approx(alone, rel=0.01)
    assert f == pytest.approx(response.omega[0] / (2 * np.pi), rel=1e-4)
    at = probe_response(response, vector, np.array([f, 0.5 * f]))
    assert abs(np.angle(at[0]) + np.pi / 2) < 0.05 and abs(np.angle(at[1])) < 0.05
    assert abs(at[0]) == pytest.approx(amplitude)
    stress = von_mises(nodal_stress(one.blade, displacement_at(response, f)))
    assert stress.max() > 0 and np.isfinite(stress).all()


def test_pressure_reaches_the_whole_face():
    """The resultant of a uniform pressure on the rim points inwards and has the size of pressure
    times chord area.
    """
    one = bodies(bump=0.0)
    load = pressure_load(one, "tip", 1e5).reshape(-1, 3).sum(0)
    area = 2 * 0.25 * np.sin(np.pi / 6) * 0.03
    assert np.linalg.norm(load) == pytest.approx(1e5 * area, rel=1e-3)
    assert load[0] < 0


def test_static_offset_of_rotation_and_pressure():
    one = bodies(speed=2000.0)
    alone, both = static_offset(one), static_offset(one, pressure_load(one, "tip", 1e6))
    tip = np.unique(one.mesh.faces["tip"])
    assert (np.linalg.norm(one.mesh.points[tip, :2] + alone[tip, :2], axis=1) > 0.25).all()
    assert (
        np.einsum("ni,ni->n", both[tip] - alone[tip], one.mesh.points[tip] * [1, 1, 0]).mean() < 0
    )


def test_wrong_loads_and_modes():
    one = bodies(count=COUNT, divisions=SMALL)
    for load in (np.zeros(3), np.zeros(3 * len(one.mesh.points))):
        with pytest.raises(InputError, match="load of shape"):
            linear_response(one, load)
    with pytest.raises(InputError, match="mode is 30"):
        find_linear_peak(linear_response(one, modes=5), excitation_load(one), 30)


def test_preload_is_chosen_by_the_scene():
    """Second-order in the strain: the two preloads part with the fourth power of the speed."""
    parted = []
    for speed in (500.0, 1000.0):
        linear, exact = bodies(speed), bodies(speed)
        scene = replace(exact.scene, operation=replace(exact.scene.operation, preload="nonlinear"))
        exact = Bodies(scene, exact.mesh)
        f, g = (wheel_modes(b, 2, [2])[0].frequencies for b in (linear, exact))
        parted.append(abs(g / f - 1).max())
    assert 0 < parted[1] < 1e-2
    assert 10 < parted[1] / parted[0] < 24


def test_curve_holds_every_resonance_and_its_half_power_points():
    """Peaks of the curve are the resonances; across each the amplitude falls to 1/sqrt 2 at the
    modal damping ratio.
    """
    one = bodies(order=2)
    found = forced_response_answer(one, [("excitation", 0.0)], Damping(structural=0.004), count=2)
    assert half_widths(found.response) == pytest.approx(0.002)
    points, row = found.points, found.resonances.iloc[0]
    below = points["frequency"] < 1.2 * row["natural"]
    assert row["amplitude"] == pytest.approx(points["amplitude"][below].max(), rel=1e-3)
    vector = excitation_load(one) / one.scene.excitation.force
    sides = abs(probe_response(found.response, vector, row["natural"] * np.array([0.998, 1.002])))
    assert sides / row["amplitude"] == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert np.linalg.norm(found.shapes[0], axis=1).max() == pytest.approx(row["largest"])
    assert row["peaked"]
    doubled = forced_response_answer(
        one, [("excitation", 0.0), ("excitation", 0.0)], Damping(structural=0.004), count=2
    )
    assert doubled.points["amplitude"].to_numpy() == pytest.approx(
        2 * points["amplitude"].to_numpy()
    )


def test_words_for_loads_and_damping():
    assert read_loads("") == [] and read_loads("excitation, tip=2 kPa") == [
        ("excitation", 0.0),
        ("tip", 2000.0),
    ]
    assert read_damping("ratio=0.1 %, structural=0.002") == Damping(ratio=0.001, structural=0.002)
    assert read_damping("mass=20 1/s, stiffness=1e-7 s") == Damping(mass=20.0, stiffness=1e-7)
    for read, text, words in (
        (read_loads, "tip", "face=pressure"),
        (read_loads, "tip=2 N", "Pa"),
        (read_damping, "viscous=1", "'viscous' is unknown"),
        (read_damping, "mass=1 kg", "1/s"),
        (read_damping, "ratio=1 %, ratio=2 %", "ratio is given twice"),
        (read_damping, "ratio=200 %", "ratio = 2: expected 0 to 0.5"),
    ):
        with pytest.raises(InputError, match=words):
            read(text)
    one = bodies(count=COUNT, divisions=SMALL)
    with pytest.raises(InputError, match="tip"):
        forced_response_answer(one, [("tpi", 1.0)])
    with pytest.raises(InputError, match="some damping"):
        forced_response_answer(one, (), Damping())


def test_table_of_stresses_has_the_extremes_of_every_state():
    """Stress is linear in the state, so a scaled mode and a resonance of it have the same place and
    ratio.
    """
    one = bodies(speed=1000.0)
    modes = wheel_modes(one, 2, [2])[0]
    states = stress_states(one, modes, 2)
    assert list(states) == ["rotation", "mode 1 for 1 mm", "mode 2 for 1 mm"]
    table, fields, cells = stress_table(one, {**states, "half": 0.5j * states["mode 1 for 1 mm"]})
    table = table.set_index("state")
    first, half = table.loc["mode 1 for 1 mm"], table.loc["half"]
    assert first["largest"] == pytest.approx(1e-3)
    assert half["von_mises"] == pytest.approx(first["von_mises"] / 2)
    assert (half["x"], half["y"]) == (first["x"], first["y"])
    assert first["pressing"] == pytest.approx(
        -first["principal"]
    )  # every motion comes back with the other sign
    turning = fields["rotation"]
    assert table.loc["rotation", "von_mises"] == pytest.approx(turning["von Mises"].max())
    assert table.loc["rotation", "von_mises_gauss"] == pytest.approx(
        cells["rotation"]["von Mises at Gauss points"].max()
    )
    assert all(
        len(values["von Mises at Gauss points"]) == sum(map(len, one.mesh.bodies.values()))
        for values in cells.values()
    )
    assert (turning["smallest principal"] <= turning["largest principal"]).all()
    assert "smallest principal" not in fields["half"]
    assert (table["von_mises_gauss"] > 0.3 * table["von_mises"]).all()


@pytest.mark.mpi
def test_ranks_share_out_the_stresses(monkeypatch):
    """Each state is one rank's work, and the table is the same as that of one rank."""
    done = []
    recorded = gauss_and_nodal_stress

    def counted(body, u, large=False, heated=False):
        done.append(1)
        return recorded(body, u, large=large, heated=heated)

    together, alone = (bodies(comm=comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    states = stress_states(alone, wheel_modes(alone, 3, [2])[0], 3)
    reference, fields, cells = stress_table(alone, states)
    monkeypatch.setattr("bladefem.fem.stress.gauss_and_nodal_stress", counted)
    table, shared_fields, shared_cells = stress_table(together, states)
    assert MPI.COMM_WORLD.allreduce(len(done)) == len(states)
    pd.testing.assert_frame_equal(table, reference)
    for kept, expected in ((shared_fields, fields), (shared_cells, cells)):
        assert list(kept) == list(expected)
        for name, each in expected.items():
            for kind, values in each.items():
                np.testing.assert_allclose(kept[name][kind], values, rtol=1e-12)
