"""Campbell table against solves at each speed; crossings of the right wave; texts of speeds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from wheels import bodies

from bladefem.errors import InputError
from bladefem.fem.compat import PETSc
from bladefem.fem.constraint import constrain
from bladefem.fem.gyroscopic import coupling, waves
from bladefem.fem.modes import modes
from bladefem.hbm.linear_resonances import wave_frequencies
from bladefem.scene.tables import Solver
from bladefem.scene.toml import load_scene
from bladefem.study.modes import survey as survey_module
from bladefem.study.modes.campbell import campbell_tables, read_speeds, speed_models
from bladefem.study.modes.survey import Wanted, survey_modes
from bladefem.study.pipeline.bodies import Bodies

PLANE = Path(__file__).parents[2] / "scenes" / "plane.toml"


def campbell_table(wheel, speeds, diameters, count=5):
    """One row a mode and speed, without the crossings."""
    models = speed_models(wheel, speeds, diameters, count)
    return pd.concat([model.table(speeds) for model in models], ignore_index=True)


@pytest.fixture(scope="module")
def wheel():
    return bodies(speed=2500.0)


def test_lines_equal_solves_at_each_speed(wheel):
    """Measured 2e-10 without and 7e-8 with Coriolis forces, of frequencies that the rotation moves
    by some per cent; with the lowest modes alone it was 3e-5. The error reported holds.
    """
    speeds = [0.0, 900.0, 2500.0, 3000.0]
    table = campbell_table(wheel, speeds, [0, 2], 4)
    assert (table["error"] < 1e-5).all()
    for n in (0, 2):
        for speed in speeds:
            exact = _many_modes(wheel, n, speed)
            rows = table[(table["nodal_diameter"] == n) & (table["speed"] == speed)]
            np.testing.assert_allclose(rows["frequency"], exact.frequencies[:4], rtol=1e-8)
            split = waves(exact, coupling(wheel.blade_at(speed), exact), speed)
            for column in ("forward", "backward"):
                off = abs(rows[column].to_numpy() / getattr(split, column)[:4] - 1)
                assert off.max() < 5e-7
                # 3e-9: what the reference leaves out
                assert (off < 2 * rows["error"].to_numpy() + 3e-9).all()


def _many_modes(wheel, diameter, speed):
    """So many modes that the next ones move waves by some 1e-9."""
    return modes(constrain(wheel.blade_at(speed), "clamp", diameter), 120)


def test_orders_cross_the_wave_that_they_excite(wheel):
    """Of 6 blades EO 2 meets the backward wave, EO 4 the forward wave of nodal diameter 2, EO 3 a
    standing one.
    """
    found = campbell_tables(wheel, np.linspace(0, 12000, 7), [2, 3, 4], count=2)
    assert set(found.table["nodal_diameter"]) == {2, 3}
    assert 2500.0 in set(found.table["speed"])
    for order, n, column in ((2, 2, "backward"), (4, 2, "forward"), (3, 3, "forward")):
        for _, row in found.crossings[found.crossings["engine_order"] == order].iterrows():
            assert row["frequency"] == pytest.approx(order * row["speed"] / (2 * np.pi))
            exact = _many_modes(wheel, n, row["speed"])
            split = waves(exact, coupling(wheel.blade, exact), row["speed"])
            line = getattr(split, column)
            # with f^2 straight in speed^2 between the speeds of the table they were 1e-4 off
            assert row["frequency"] == pytest.approx(line[int(row["mode"]) - 1], rel=1e-6)
    assert len(found.crossings) and list(found.margins["engine_order"]) == [2, 3, 4]
    assert len(found.interference) == 6


def test_standing_waves_have_coriolis_forces(wheel):
    """Nodal diameter N/2 of 6 blades at one speed, by the equation of its waves in 20 modes."""
    found = campbell_tables(wheel, [0.0, 1000.0, 2500.0], [3], count=2)
    exact = modes(constrain(wheel.blade_at(2500.0), "clamp", 3), 20)
    moved = wave_frequencies(2 * np.pi * exact.frequencies, 2500.0 * coupling(wheel.blade, exact))
    expected = moved[:2] / (2 * np.pi)
    shift = abs(expected / exact.frequencies[:2] - 1)
    assert shift.max() > 1e-4
    for table in (found.interference, found.margins):
        off = [abs(f / expected - 1).min() for f in table["frequency"]]
        assert max(off) < 0.1 * shift.max()


def test_no_order_crosses_rigid_motions():
    """A free wheel turns and slides along its axis without force at any speed; small matrices gave
    these motions up to 0.01 Hz, which orders met at 0.003 rad/s.
    """
    free = bodies(count=6, divisions=(1, 1, 1), inner=0.24, bump=0.0)
    scene = replace(free.scene, support=replace(free.scene.support, clamp=""))
    found = campbell_tables(Bodies(scene, free.mesh), [0.0, 300.0, 600.0], [6, 12], 3)
    rigid = found.table[found.table["mode"] <= 2]
    assert (rigid["frequency"] == 0).all() and rigid["forward"].max() < 1e-8
    assert found.crossings.empty


@pytest.mark.parametrize("speed", [2.0, 15.0, 300.0])
def test_rotation_drives_the_translations_of_a_free_wheel(speed):
    """Across its axis: at rest in space they are circles of the speed's own frequency. Slow wheels
    were solved, with frequencies of 0 and twice the speed.
    """
    free = bodies(count=6, divisions=(1, 1, 1), inner=0.24, bump=0.0)
    scene = replace(free.scene, support=replace(free.scene.support, clamp=""))
    with pytest.raises(InputError, match="no steady place"):
        campbell_tables(Bodies(scene, free.mesh), [0.0, speed], [1], 3)


@pytest.mark.parametrize(
    ("text", "rpm"),
    [
        ("0, 2000, 4000 rpm", [0, 2000, 4000]),
        ("0, 500, ..., 2000 rpm", [0, 500, 1000, 1500, 2000]),
        ("0, 1000, ..., 1500 rpm", [0, 1000, 1500]),
        ("100 rad/s, 3000 rpm", [100 * 30 / np.pi, 3000]),
    ],
)
def test_speeds_are_read(text, rpm):
    np.testing.assert_allclose(np.array(read_speeds(text)) * 30 / np.pi, rpm)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "0, ..., 2000 rpm",
        "0, 500, ...",
        "0, 500, ..., 400 rpm",
        "..., 3 rpm",
        "fast",
        "0, 3 Hz m",
    ],
)
def test_wrong_speeds_are_refused(text):
    with pytest.raises(InputError, match="campbell"):
        read_speeds(text)


@pytest.mark.parametrize("text", ["8000", "0, 2000, 8000"])
def test_speeds_without_a_unit_are_refused(text):
    with pytest.raises(InputError, match=f"expected a unit, such as '{text} rpm'"):
        read_speeds(text)


def test_a_unit_without_a_speed_is_not_told_twice():
    with pytest.raises(InputError, match="such as '0, 2000, 4000 rpm'"):
        read_speeds("0, 1000, ..., rpm")


def test_too_few_speeds(wheel):
    with pytest.raises(InputError, match="at least two"):
        campbell_table(wheel, [1.0], [0])


@pytest.mark.mpi
@pytest.mark.several_ranks
@pytest.mark.two_ranks
def test_campbell_does_not_depend_on_ranks():
    from mpi4py import MPI

    a, b = (
        campbell_table(bodies(comm=comm), [0.0, 1500.0, 3000.0], [1], 3)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    np.testing.assert_allclose(a.drop(columns="error"), b.drop(columns="error"), rtol=1e-8)


def test_the_scenes_eigensolver_solves_the_modes_of_every_command(tmp_path):
    """Also those of a single blade, and of other speeds: an option that SLEPc does not know is
    refused where SLEPc is asked.
    """
    wrong = Solver(petsc="-eps_monitr")
    given = bodies()
    wheel = Bodies(replace(given.scene, solver=wrong), given.mesh)
    with pytest.raises(InputError, match="-eps_monitr"):
        campbell_table(wheel, [0.0, 100.0], [1], 2)
    plane = load_scene(PLANE, ["mesh.size=8 mm", "solver.petsc=-eps_monitr"])
    try:
        with pytest.raises(InputError, match="-eps_monitr"):
            survey_modes(plane, tmp_path, Wanted())
    finally:
        # PETSc keeps it, and later commands of this process would warn of it
        PETSc.Options().delValue("eps_monitr")


def test_a_finished_folder_keeps_its_campbell_tables(tmp_path, monkeypatch):
    """Of the same speeds; others, and another engine order, are computed."""
    speeds = []

    def counted(bodies, wanted, orders):
        speeds.append(list(wanted))
        return campbell_tables(bodies, wanted, orders)

    monkeypatch.setattr(survey_module, "campbell_tables", counted)

    def surveyed(speed, order=2):
        changes = ["mesh.scale=3", f"excitation.engine_order={order}"]
        return survey_modes(load_scene(PLANE, changes), tmp_path, Wanted(speeds=[0.0, speed]))

    made, found = surveyed(100.0), surveyed(100.0)
    assert speeds == [[0.0, 100.0]]
    assert any(text.startswith("campbell: found in the folder") for text in found.run.messages)
    for name in ("table", "crossings", "interference", "margins"):
        one, other = (getattr(survey.campbell, name) for survey in (made, found))
        pd.testing.assert_frame_equal(one, other)
    surveyed(200.0)
    surveyed(200.0, order=3)
    assert speeds == [[0.0, 100.0], [0.0, 200.0], [0.0, 200.0]]
