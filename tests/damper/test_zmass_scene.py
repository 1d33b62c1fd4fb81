"""The Z-shaped mass from its scene: finite-element pressure, then motion. Sizes of the shipped
scene, coarser mesh.
"""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from bladefem.cli.main import main
from bladefem.damper.loops import FoundationMotion, main_axis, spectrum, steady
from bladefem.damper.zmass import Footprint, MassOnFoundation
from bladefem.errors import InputError
from bladefem.io.stage_cache import read_results
from bladefem.report.zmass import motion_headlines, motion_table
from bladefem.scene.toml import load_scene, vary
from bladefem.study.kinds.zmass import (
    cluster_nodes,
    foundation_drives,
    mass_on_foundation,
    press_mass,
    steady_motions,
)

SCENE = load_scene("scenes/zmass.toml", ["mesh.size=7 mm"])


@pytest.fixture(scope="module")
def pressed():
    return press_mass(SCENE)


def test_the_solid_has_the_mass_and_inertia_of_table_1(pressed):
    body = mass_on_foundation(SCENE, pressed.seat)
    assert body.mass == pytest.approx(0.035, rel=1e-3)
    assert body.inertia == pytest.approx(14.68e-6, rel=1e-3)


def test_pressure_is_balanced_symmetric_and_highest_at_the_edge(pressed):
    seat = pressed.seat
    share = seat.force / seat.force.sum()
    assert seat.force.sum() == pytest.approx(50, rel=1e-10)
    assert (
        np.abs(share @ seat.patch.points[:, :2]).max() < 1e-6
    )  # [m]; exact for the weights, not the nodes
    assert seat.complementarity < 1e-9
    inside = np.abs(seat.patch.points[:, 1] - 0.0173) < 0.003  # middle of the upper bar
    assert seat.pressure.max() > 1.1 * seat.pressure[inside].mean()


def test_pressure_is_linear_in_the_load(pressed):
    """The paper's Eq. 27, to rounding: the contact is a receding one."""
    more = press_mass(vary(SCENE, study__loads=(80.0,))).seat
    np.testing.assert_allclose(more.force / 80, pressed.seat.force / 50, rtol=1e-8)


def test_rigid_foundation_passes_the_patch_test():
    """Uniform pressure on top of a prism on a rigid plane is uniform below; here 48 times as stiff
    as the mass.
    """
    pressure = press_mass(vary(SCENE, material__blade__E=1e13)).seat.pressure
    assert np.ptp(pressure) / pressure.mean() < 0.03


def test_loops_and_drift_of_the_paper(pressed):
    found = list(steady_motions(SCENE, mass_on_foundation(SCENE, pressed.seat), 1000))
    assert [result.loops for _, result in found] == [1, 4, 2, 1]  # Fig. 10
    assert found[2][1].drift[0] == pytest.approx(0.105, rel=0.01)  # 0.1057 m/s at 50 Hz
    assert abs(found[0][1].drift[0]) < 1e-6


def test_skewed_top_pressure_moves_the_resultant_and_turns_the_mass():
    """The moment of the load: share . x = skew x I / (A reach), here for x and y; 2 % by the
    faceted pressure.
    """
    scene = vary(
        SCENE,
        foundation__skew=(0.5, 0.3),
        foundation__amplitude=(0.005, 0.003),
        foundation__ratios=(0.5,),
    )
    body = mass_on_foundation(vary(scene, contact__points=None), press_mass(scene).seat)
    even = mass_on_foundation(vary(SCENE, contact__points=None), press_mass(SCENE).seat)
    square = np.einsum(
        "n,ni,nj->ij", even.footprint.stiffness, even.footprint.points, even.footprint.points
    )
    wanted = square @ np.array(scene.foundation.skew) / (scene.z_mass.width / 2)
    assert body.footprint.share @ body.footprint.points == pytest.approx(wanted, rel=0.05)
    _, result = next(steady_motions(scene, mass_on_foundation(scene, press_mass(scene).seat), 500))
    assert np.abs(result.motion.velocity[:, 2]).max() > 1.0  # rad/s


@pytest.mark.parametrize(("along", "phase"), [((0.0, 0.005), 0.0), ((0.003, 0.004), 0.0)])
def test_loops_and_amplitude_do_not_depend_on_the_axes(along, phase):
    """Friction on one point knows no direction: what is reported along y, or aslant, is that along x."""
    body = MassOnFoundation(footprint=Footprint(np.zeros((1, 2)), np.ones(1)))
    drives = [
        FoundationMotion(Fraction(1, 2), amplitude=a, phase=phase) for a in ((0.005, 0.0), along)
    ]
    found = [(drive, steady(body, drive, 500)) for drive in drives]
    table = motion_table(found)
    assert list(table["loops"]) == [2, 2]
    assert table["amplitude"][1] == pytest.approx(table["amplitude"][0], rel=1e-9)


def test_a_circle_has_x_as_its_axis():
    assert list(main_axis((0.005, 0.005), np.pi / 2)) == [1, 0]
    assert list(main_axis((0.0, 0.005), np.pi / 2)) == [0, 1]
    assert main_axis((1.0, 1.0), np.pi) == pytest.approx(np.array([1, -1]) / np.sqrt(2))


def test_a_mass_that_never_slips_has_no_amplitude_but_the_linear_one():
    """What it does from rest swings on at its own frequency for ever: the line at the foundation's
    frequency in one cycle is not the steady 1 / (1 - (w / w0)^2) of the motion.
    """
    body = MassOnFoundation(
        mass=1.0, kt=1.0e6, mu=10.0, footprint=Footprint(np.zeros((1, 2)), np.ones(1))
    )
    drive = FoundationMotion(Fraction(0), frequency=100.0, amplitude=(1e-6, 0.0))
    result = steady(body, drive, 200)
    linear = 1e-6 / (1 - (2 * np.pi * 100) ** 2 / 1e6)
    marched = spectrum(result)[1][0, -1]
    assert abs(marched / linear - 1) > 0.05
    (line,) = motion_headlines([(drive, result)])
    assert line.value == "not determined" and "never slips" in line.uncertainty
    assert np.isnan(motion_table([(drive, result)])["amplitude"][0])


@pytest.mark.parametrize(
    ("residual", "mu", "known"), [(5e-4, 0.3, True), (5e-4, 10.0, False), (5e-3, 0.3, False)]
)
def test_a_nearly_steady_motion_is_known_where_friction_damps_what_is_left(residual, mu, known):
    body = MassOnFoundation(
        mass=1.0, kt=1.0e6, mu=mu, footprint=Footprint(np.zeros((1, 2)), np.ones(1))
    )
    drive = FoundationMotion(Fraction(0), frequency=100.0, amplitude=(1e-4, 0.0))
    found = replace(steady(body, drive, 200, most=2), residual=residual, reason="not periodic")
    assert found.slips == (mu < 1)
    assert found.is_known == known


def test_the_march_shows_its_periods():
    """Stiff contacts take minutes."""
    seen = []

    def watch(items, label):
        for item in items:
            seen.append((label, item))
            yield item

    drive = FoundationMotion(Fraction(0))
    result = steady(MassOnFoundation(), drive, 500, progress=watch)
    assert len(seen) == result.periods and seen[0][0] == "motion, load at 0 Hz"


def test_steps_follow_the_stuck_mass_in_slow_motions(pressed):
    """At 1 Hz 2000 steps are longer than the stuck mass allows; 1 um leaves it stuck, and carries it
    along.
    """
    slow = vary(
        SCENE,
        foundation__frequency=1.0,
        foundation__amplitude=(1e-6, 0.0),
        foundation__ratios=(0.0,),
    )
    body = mass_on_foundation(slow, pressed.seat)
    ((_, result),) = steady_motions(slow, body)
    assert np.abs(result.motion.position[:, 0]).max() == pytest.approx(1e-6, rel=2e-3)
    stiff = vary(slow, contact__kt=1e12)
    with pytest.raises(InputError, match=r"foundation.frequency = 1 Hz: \d+ steps"):
        list(steady_motions(stiff, mass_on_foundation(stiff, pressed.seat)))


@pytest.mark.parametrize(
    "change",
    [
        "study.loads=['50 N', '60 N']",
        "contact.bedded=false",
        "contact.normal='prescribed'",
    ],
)
def test_what_the_mass_does_not_use_is_refused(change):
    with pytest.raises(InputError, match=change.split("=")[0]):
        load_scene("scenes/zmass.toml", [change])


def test_pull_balances_mean_friction_while_the_mass_slips():
    """A steady force is balanced by the mean friction force of the steady motion; the mass drifts
    along it.
    """
    body = MassOnFoundation(footprint=Footprint(np.zeros((1, 2)), np.ones(1)))
    result = steady(body, FoundationMotion(Fraction(0), pull=(2.0, 0.0)), 1000)
    assert result.reason == "periodic"
    assert result.motion.force[:, 0].mean() == pytest.approx(-2.0, rel=1e-6)
    assert result.drift[0] > 0.1


def test_clusters_stay_on_the_solid(pressed):
    patch = pressed.seat.patch
    label = cluster_nodes(patch.points[:, :2], patch.area, 20)
    centres = [
        np.bincount(label, patch.area * x) / np.bincount(label, patch.area)
        for x in patch.points[:, :2].T
    ]
    near = np.linalg.norm(
        patch.points[None, :, :2] - np.column_stack(centres)[:, None], axis=2
    ).min(axis=1)
    assert label.max() == 19
    assert near.max() < 0.005  # within an element of a node


def test_a_skew_beyond_one_and_another_kind_of_scene_are_refused():
    with pytest.raises(InputError, match=r"foundation\.skew.*at most 1"):
        vary(SCENE, foundation__skew=(0.8, 0.5))
    with pytest.raises(InputError, match="expected 'z mass'"):
        press_mass(load_scene("scenes/punch.toml"))


def test_scene_drives_the_motion(tmp_path, monkeypatch):
    """``bladefem run``, without the slow picture of the mesh."""
    monkeypatch.setattr(
        "bladefem.view.mesh.draw_mesh", lambda _, file, title: Path(file).write_bytes(b"")
    )
    options = [
        "--set",
        "mesh.size=8 mm",
        "--set",
        "foundation.ratios=0.5, 1",
        "--set",
        "contact.points=10",
    ]
    assert foundation_drives(SCENE)[1].ratio == Fraction(1, 4)
    assert main(["run", "scenes/zmass.toml", "-o", str(tmp_path), "-q", *options]) == 0
    text = (tmp_path / "motion.csv").read_text()
    assert "1/2" in text and "loops" in text
    assert (tmp_path / "report.html").stat().st_size > 100_000
    assert (tmp_path / "pressure.vtu").stat().st_size > 3_000
    face = read_results(tmp_path / "results.nc", "resultants").sel(load=50.0, seat="right")
    assert (
        float(face["normal_force"]) == pytest.approx(50.0, rel=1e-6)
        and face["normal_force"].attrs["units"] == "N"
    )
    assert read_results(tmp_path / "results.nc", "motion")["drift_x"].attrs["units"] == "m/s"
