"""From a scene to the whole wheel: the same model as the tuned sector's, and bad input refused
before long work.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mistuned import (
    COARSE_MISTUNED,
    MISTUNED,
    ORDER,
    ROUGH_MISTUNED,
    SECTORS,
    reduced_wheel,
)

from bladefem.errors import InputError
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.report.fatigue import (
    save_fatigue_vtu,
    utilisation_drawing,
    utilisation_table,
    worst_utilisation,
)
from bladefem.report.scatter_sentences import scatter_sentences
from bladefem.report.scatter_tables import scatter_table
from bladefem.report.wheel import pattern_headlines, pattern_table
from bladefem.scene.other_blades import other_blades
from bladefem.scene.tables import Fatigue
from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.family import family_member
from bladefem.study.adaptive.settings import first_settings
from bladefem.study.fatigue import fatigue_utilisation, haigh_diagram
from bladefem.study.mistuning import peak_choice, stage
from bladefem.study.mistuning.blade_stress import (
    SolvedWheel,
    WheelShapes,
    all_modes,
    blade_motion,
)
from bladefem.study.mistuning.deciding_blades import blade_groups
from bladefem.study.mistuning.drawn_wheels import scatter_balance
from bladefem.study.mistuning.engine_orders import order_forces, own_harmonic
from bladefem.study.mistuning.odd_blade import odd_blade_stress
from bladefem.study.mistuning.other_blades import BladeChange, OtherBlades
from bladefem.study.mistuning.pattern_sentences import pattern_sentences
from bladefem.study.mistuning.peak_choice import richer_balance
from bladefem.study.mistuning.stage import scatter_of_run, with_whole_wheel
from bladefem.study.mistuning.validate import refuse_scatter, scene_deviations
from bladefem.study.mistuning.wheel_utilisation import (
    wheel_utilisation,
    wheel_utilisation_message,
)
from bladefem.study.mistuning.whole_wheel import blade_readings, reduce_wheel, whole_wheel
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import family_of_case, load_cases
from bladefem.study.pipeline.damped_motion import SolvedPoint, damped_motion, stress_of_motion
from bladefem.study.pipeline.preflight import refuse_run
from bladefem.study.pipeline.stage_inputs import stage_key
from bladefem.study.pipeline.utilisation import (
    blade_nodes,
    run_utilisation,
)
from bladefem.wheel.linear_motion import free_wheel
from bladefem.wheel.model import Pattern, frequency_pattern
from bladefem.wheel.solve import solve_wheel


@pytest.fixture(scope="module")
def reduced():
    return reduced_wheel(ROUGH_MISTUNED)


def test_elements_that_the_scene_gives_can_be_joined(reduced):
    """As the error by harmonics asks where contacts lift off; the scene's two become one."""
    scene, run, patches, _, case, settings = reduced
    family = family_of_case(scene, run.mesh, run.reduced, patches, case)
    one = family_member(family, replace(settings, points=1))
    np.testing.assert_array_equal(one.groups, [0, 0, 1, 1])
    assert one.model.elements.kt == pytest.approx(case.elements.kt.reshape(2, 2).sum(axis=1))


TIGHT = replace(DEFAULT_OPTIONS, tolerance=1e-13)
# where their number is no question
ONE_HARMONIC = ("model.harmonics=1", "model.samples=64")


@pytest.mark.parametrize("finest", [2, None])
@pytest.mark.parametrize("share", [0.99, 1.045])
def test_whole_wheel_is_the_tuned_sector(reduced, finest, share):
    """Sticking and slipping, with the points of the scene and with those joined from all nodes."""
    scene, run, patches, sector, _, _ = reduced
    scene = vary(scene, contact__points=finest)
    (case,) = load_cases(scene, run.mesh, run.contact)
    settings = first_settings(scene)
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    family = family_of_case(scene, run.mesh, run.reduced, patches, case)
    member = family_member(family, settings)
    assert (len(member.groups) > len(member.model.elements.kt)) == (finest is None)
    omega = share * member.model.side(1).omega[0]
    one = solve(member.model, omega, 1, 72, options=TIGHT)
    found = solve_wheel(wheel, omega, 1, 72, options=TIGHT)
    assert one.converged and found.converged
    assert (one.states["slip"] > 0) == (share > 1)
    turn = np.exp(2j * np.pi * ORDER / SECTORS * np.arange(SECTORS))
    np.testing.assert_allclose(
        found.probe[:, 1, 0], one.probe[1, 0] * turn, atol=1e-9 * abs(one.probe).max()
    )


def test_a_stiff_layer_is_that_of_the_tuned_sector(reduced):
    """Part of it in series, or softened throughout, as the settings of the curve say."""
    scene, run, patches, sector, case, settings = reduced
    n = len(case.elements.kt)
    e = case.elements
    series = -0.5 * np.column_stack([1 / e.kn, 1 / e.kt, 1 / e.kt])
    case = replace(case, series=series)
    family = family_of_case(scene, run.mesh, run.reduced, patches, case)
    answers = []
    for softened in (False, True):
        own = replace(settings, softened=softened)
        wheel = whole_wheel(scene, run.mesh, sector, patches, case, own)
        assert (wheel.series is None) == softened
        assert softened or wheel.series.shape == (n, 3)
        model = family_member(family, own).model
        omega = 0.99 * model.side(1).omega[0]
        one = solve(model, omega, 1, 72, options=TIGHT)
        found = solve_wheel(wheel, omega, 1, 72, options=TIGHT)
        assert one.converged and found.converged
        turn = np.exp(2j * np.pi * ORDER / SECTORS * np.arange(SECTORS))
        scale = abs(one.probe).max()
        np.testing.assert_allclose(found.probe[:, 1, 0], one.probe[1, 0] * turn, atol=1e-9 * scale)
        answers.append(one.probe[1, 0])
    assert abs(answers[1] - answers[0]) > 1e-3 * abs(answers[0])


def test_stiffer_blades_raise_the_resonance_by_the_aerofoils_share(reduced):
    """1 % on all blades: the wheel's resonance rises, by less than the blades' own."""
    scene, run, patches, sector, case, settings = reduced
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    own = wheel.sectors[ORDER].omega[0]
    pattern = frequency_pattern(sector.families, np.full(SECTORS, 0.01))
    grid = own * np.linspace(0.999, 1.011, 241)
    size = [abs(free_wheel(wheel, w, 1, pattern)[:, 1, 0]) for w in grid]
    # all blades alike: the tuned wave in all of them
    np.testing.assert_allclose(np.ptp(size, axis=1), 0, atol=1e-9 * np.max(size))
    rise = grid[int(np.argmax(np.max(size, axis=1)))] / own - 1
    assert 0.002 < rise < 0.0101


@pytest.fixture(scope="module")
def shapes(reduced):
    scene, run, patches, sector, _, _ = reduced
    bodies = Bodies(scene, run.mesh)
    _, readings = blade_readings(bodies, run.clamped, len(sector.families))
    return WheelShapes(bodies, patches, all_modes(bodies), readings)


@pytest.mark.parametrize("finest", [2, None])
def test_worst_blade_of_a_tuned_wheel_is_used_as_the_tuned_one(reduced, shapes, finest):
    """No deviation: the utilisation at every node of every blade is that of the sector, also where
    contact points are joined from all nodes.
    """
    scene, run, patches, sector, _, _ = reduced
    scene = vary(scene, contact__points=finest)
    (case,) = load_cases(scene, run.mesh, run.contact)
    settings = first_settings(scene)
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    family = family_of_case(scene, run.mesh, run.reduced, patches, case)
    model = family_member(family, settings).model
    # all contacts slip there
    omega = 1.045 * model.side(1).omega[0]
    one = solve(model, omega, 1, 72, options=TIGHT)
    pattern = frequency_pattern(sector.families, np.zeros((SECTORS, 3)))
    found = solve_wheel(wheel, omega, 1, 72, pattern=pattern, options=TIGHT)
    assert one.converged and one.states["slip"] == len(one.w)
    points = settings.points
    tuned_motion = damped_motion(
        shapes.bodies, patches, shapes.modes, SolvedPoint(case, one, points)
    )
    stress = stress_of_motion(shapes.bodies, case, tuned_motion)
    diagram = haigh_diagram(Fatigue(endurance=3e8, ultimate=9e8))
    blade = blade_nodes(run.mesh)
    place = run.mesh.points[blade]
    mean = run.strength.mean[blade]
    tuned = fatigue_utilisation(diagram, place, stress.field[blade], mean)
    solved = SolvedWheel(shapes, wheel, pattern, case, found, points)
    for number in (0, 5):
        motion = blade_motion(solved, number)
        own = stress_of_motion(shapes.bodies, case, motion)
        used = fatigue_utilisation(diagram, place, own.field[blade], mean)
        np.testing.assert_allclose(used.used, tuned.used, rtol=0, atol=1e-9 * tuned.used.max())
        assert used.worst == tuned.worst


def test_blade_of_a_mistuned_wheel_moves_as_in_the_balance(reduced, shapes):
    """Waves of all nodal diameters add up to the amplitude that the reduced wheel has."""
    scene, run, patches, sector, case, settings = reduced
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    omega = 0.99 * wheel.sectors[ORDER].omega[0]
    deviation = 0.01 * np.random.default_rng(3).normal(size=(SECTORS, 3))
    pattern = frequency_pattern(sector.families, deviation)
    point = solve_wheel(wheel, omega, 3, 72, pattern=pattern)
    assert point.converged and np.ptp(point.size()) > 0.05 * point.size().max()
    solved = SolvedWheel(shapes, wheel, pattern, case, point, settings.points)
    for number in (0, int(np.argmax(point.size()))):
        motion = blade_motion(solved, number)
        assert motion.mismatch < 2e-3
        assert abs(motion.probe[0]) == pytest.approx(abs(point.probe[number, 1, 0]), rel=2e-3)
    # the deviations' own forces are not negligible: without them the motion is another one
    tuned = replace(pattern, stiffness=np.zeros_like(pattern.stiffness))
    other = blade_motion(replace(solved, pattern=tuned), number)
    assert other.mismatch > 0.02


def test_blade_of_another_shape_that_is_the_same_has_the_others_stress(reduced):
    """Meshed and solved by itself between cut faces that move as the wheel's do. Its damping is
    proportional to mass, that of the wheel a ratio of each mode.
    """
    scene, run, patches, _, case, settings = reduced
    bodies = Bodies(scene, run.mesh)
    sector = reduce_wheel(bodies, patches, 6, run.clamped, 3, run.modes, root=True)
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    _, readings = blade_readings(bodies, run.clamped, 3, run.modes, root=True)
    deviation = 0.01 * np.random.default_rng(3).normal(size=(SECTORS, 3))
    deviation[4] = 0
    families = frequency_pattern(sector.families, deviation).stiffness
    stiffness = np.zeros((SECTORS, readings.shape[1], readings.shape[1]))
    stiffness[:, :3, :3] = families
    pattern = Pattern(stiffness)
    point = solve_wheel(wheel, 0.98 * wheel.sectors[ORDER].omega[0], 3, 72, pattern=pattern)
    shapes = WheelShapes(bodies, patches, all_modes(bodies), readings)
    solved = SolvedWheel(shapes, wheel, pattern, case, point, settings.points)
    motion, own = odd_blade_stress(run, solved, 4, scene)
    stress = stress_of_motion(bodies, case, motion)
    assert own.largest == pytest.approx(stress.largest, rel=2e-6)
    np.testing.assert_allclose(own.field, stress.field, rtol=0, atol=1e-4 * stress.largest)
    largest = abs(run.strength.mean).max()
    np.testing.assert_allclose(own.mean, run.strength.mean, rtol=0, atol=1e-9 * largest)
    # what holds its coordinates is of the size of the damping
    assert own.mismatch < 2 * scene.operation.damping


@pytest.fixture(scope="module", autouse=True)
def shapes_found_once():
    """A stress that follows after a kept reduction solves all nodal diameters again: here once for
    all runs of the same sector.
    """
    known = {}
    solve_modes = stage.all_modes

    def all_modes_once(bodies, reduced=0):
        key = stage_key("modes", bodies.scene)
        if reduced or key not in known:
            known[key] = solve_modes(bodies, reduced)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage, "all_modes", all_modes_once)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Holds the stages that several tests have in common."""
    return tmp_path_factory.mktemp("run")


def test_a_second_run_finds_the_wheel(folder):
    """The sector in all nodal diameters and the wheel's response are kept like other stages."""
    scene = load_scene(MISTUNED, ROUGH_MISTUNED)
    first = with_whole_wheel(pipeline.run(scene, folder))
    again = with_whole_wheel(pipeline.run(scene, folder))
    for name in ("wheel_sector", "whole_wheel"):
        assert not any(text.startswith(f"{name}: found") for text in first.messages)
        assert any(text.startswith(f"{name}: found") for text in again.messages)
    np.testing.assert_array_equal(first.wheel[0].peak.by_blade, again.wheel[0].peak.by_blade)
    ((use,),) = wheel_utilisation(again)
    used = use.used
    number = again.response.best_curve
    tuned = run_utilisation(again)[number]
    assert used.used.max() > tuned.used.max()
    assert used.used.max() / tuned.used.max() == pytest.approx(again.wheel[0].factor, rel=0.1)
    said = [text for text in again.messages if text.startswith("utilisation of the mistuned wheel")]
    assert f"blade {again.wheel[0].peak.blade + 1}: {used.used.max():.3g}" in said[0]
    tables = utilisation_table(again)
    assert tables["wheel/fatigue_of_the_worst_blade"]["utilisation"][0] == used.used.max()
    assert "wheel/utilisation_of_the_worst_blade" in utilisation_drawing(again)
    (worst,) = worst_utilisation(again)
    assert worst.value == used.used.max() <= worst.bound and worst.tuned == tuned.used.max()
    # any blade within the estimated error of the highest may be that
    (response,) = again.wheel
    second = np.sort(response.peak.by_blade)[-2] / response.peak.height
    for error, reported in ((1.01 * (1 - second), True), (0.99 * (1 - second), False)):
        sentence = pattern_sentences([replace(response, truncation=error)], False)[0]
        assert ("within that error of the highest: blade" in sentence) == reported
    numbers = pattern_headlines(again.wheel, worst_utilisation(again))
    assert [number.value for number in numbers][1] == f"{worst.value:.3g}"
    # another pattern is another response of the same sector
    other = vary(scene, mistuning__pattern=None, mistuning__seed=1)
    drawn = with_whole_wheel(pipeline.run(other, folder))
    assert any(text.startswith("wheel_sector: found") for text in drawn.messages)
    assert not any(text.startswith("whole_wheel: found") for text in drawn.messages)


def test_blades_of_another_shape(tmp_path):
    """Two of one shape, meshed anew, on a wheel that is tuned otherwise."""
    entry = "aerofoil.chord_tip = 41 mm"
    overrides = [f"mistuning.blades=3: {entry}, 8: {entry}", "mistuning.pattern=none.csv"]
    # more of them are what this is not about
    overrides += ["model.harmonics=3", "model.samples=128"]
    # on cells of 30 mm the blade's own mesh and the wheel's differ by 1.1 % in stress by Delaunay
    overrides += ["mesh.algorithm=hxt"]
    scene = vary(load_scene(MISTUNED, [*ROUGH_MISTUNED, *overrides]), mistuning__pattern=None)
    scene = vary(scene, mistuning__scatter=None)
    # its stages would take the place of those that the other tests have in common
    stages = tmp_path / "run"
    run = with_whole_wheel(pipeline.run(scene, stages))
    (found,) = run.wheel
    odd = [2, 7]
    assert set(found.others.changes) == set(odd)
    shift = found.deviation[2]
    assert 0.002 < shift[0] < 0.02
    np.testing.assert_array_equal(found.deviation[7], shift)
    assert not found.deviation[np.setdiff1d(np.arange(SECTORS), odd)].any()
    assert found.factor > 1.0
    # the motion of all finite elements with the deviations' forces is that of the reduced wheel
    assert found.highest.stress.mismatch < 5e-3
    said = [text for text in run.messages if text.startswith("blades 3, 8 of another shape")]
    assert f"{100 * shift[0]:+.3g} %" in said[0]
    # one of these is the highest; its own aerofoil is a little narrower
    assert found.peak.blade in odd
    own = found.highest.own_stress
    assert own.largest == pytest.approx(found.highest.stress.largest, rel=0.1)
    assert own.mismatch < 5e-3
    assert any("its stress is that of its own mesh" in text for text in run.messages)
    # the number that is signed is that of its own elements, in vibration and rotation
    ((use, _),) = wheel_utilisation(run)
    assert use.blade is found.highest
    used = use.used
    nodes = blade_nodes(own.mesh)
    assert len(nodes) != len(blade_nodes(run.mesh))
    np.testing.assert_array_equal(used.points, own.mesh.points[nodes])
    np.testing.assert_array_equal(used.mean, own.mean[nodes])
    assert used.mean.max() == pytest.approx(run.strength.mean.max(), rel=0.05)
    assert len(utilisation_table(run)["wheel/fatigue_of_the_worst_blade"]) == 10
    save_fatigue_vtu(run, tmp_path / "fatigue.vtu")
    assert (tmp_path / "fatigue_of_the_worst_blade.vtu").exists()
    # the coarse scene's own curves hold means too, and cannot say what free ones change
    assert any("what free ones change is not known" in text for text in run.messages)
    again = with_whole_wheel(pipeline.run(scene, stages))
    assert any(text.startswith("other_blades: found") for text in again.messages)


def test_blades_of_another_stiffness_and_mass(folder, tmp_path):
    """A file with a density a blade, and a stiffness a family."""
    rng = np.random.default_rng(4)
    values = 0.01 * rng.normal(size=(SECTORS, 4))
    file = tmp_path / "pattern.csv"
    rows = [f"{b + 1}, " + ", ".join(map(repr, row.tolist())) for b, row in enumerate(values)]
    file.write_text("\n".join(["blade, mass, 1F stiffness, 2F stiffness, 1T stiffness", *rows]))
    # more of them are what this is not about
    fixed = [*ONE_HARMONIC, f"mistuning.pattern={file}"]
    scene = load_scene(MISTUNED, [*ROUGH_MISTUNED, *fixed])
    run = with_whole_wheel(pipeline.run(scene, folder))
    (found,) = run.wheel
    alone = np.sqrt((1 + values[:, 1:]) / (1 + values[:, :1])) - 1
    np.testing.assert_allclose(found.deviation, alone, atol=1e-12)
    assert found.factor > 1.0 and found.peak.unsolved == 0
    # the motion of all finite elements with the deviations' forces is that of the reduced wheel
    assert found.highest.stress.mismatch < 5e-3
    # frequencies alone are another wheel: that of the same root
    rows = [f"{b + 1}, " + ", ".join(map(repr, row.tolist())) for b, row in enumerate(alone)]
    file.write_text("\n".join(["blade, 1F, 2F, 1T", *rows]))
    other = with_whole_wheel(pipeline.run(scene, folder)).wheel[0]
    np.testing.assert_allclose(other.deviation, alone, atol=1e-12)
    assert other.factor == pytest.approx(found.factor, rel=0.1)
    assert other.peak.height != found.peak.height


def test_engine_orders_of_one_period():
    """Order 9 and 6 in a period of three to a revolution; alone it is harmonic 1."""
    scene = load_scene(MISTUNED)
    assert own_harmonic(scene) == 1
    both = vary(scene, mistuning__orders=("6: 0.5 N; 30 deg", "18: 0.1 N"))
    assert own_harmonic(both) == 3
    forces = order_forces(both, 36)
    assert sorted(forces) == [2, 3, 6]
    around = 2 * np.pi * np.arange(36) / 36
    wave = 0.5 * np.exp(1j * (6 * around + np.radians(30)))
    np.testing.assert_allclose(forces[2][:, 0], wave, atol=1e-12)
    np.testing.assert_allclose(forces[3][:, 0], 1.5 * np.exp(9j * around), atol=1e-12)


@pytest.mark.parametrize(
    ("excited", "H", "more"), [([1], 1, 3), ([1], 3, 7), ([1, 2], 2, 6), ([9, 10], 10, 30)]
)
def test_error_by_harmonics_knows_the_third_of_each_order(excited, H, more):
    """Orders 9 and 10 in a period of one revolution: twice as many harmonics as ten do not reach
    27.
    """
    wheel = SimpleNamespace(excitation=dict.fromkeys(excited))
    assert richer_balance(wheel, H, 64) == (more, max(128, 8 * (more + 1)))


def test_a_faint_further_order_moves_the_wheel_as_the_first_alone(folder):
    """Order 2 next to 3, with hardly a force: harmonics 3, 6, 9 of one period a revolution, and
    the answer of harmonics 1, 2, 3 of three.
    """
    fixed = [*ROUGH_MISTUNED, *ONE_HARMONIC]
    run = pipeline.run(load_scene(MISTUNED, fixed), folder)
    one = with_whole_wheel(run)
    faint = vary(run.scene, mistuning__orders=("2: 1e-9 N",))
    both = with_whole_wheel(replace(run, scene=faint))
    r, s = one.wheel[0], both.wheel[0]
    assert (r.harmonic, s.harmonic) == (1, 3)
    assert s.solution.probe.shape[1] == 4
    assert s.peak.height == pytest.approx(r.peak.height, rel=1e-3)
    assert s.frequency == pytest.approx(r.frequency, rel=1e-5)
    assert s.factor == pytest.approx(r.factor, rel=1e-3)
    assert s.free_factor == pytest.approx(r.free_factor, rel=1e-6)
    assert s.highest.stress.largest == pytest.approx(r.highest.stress.largest, rel=5e-3)
    np.testing.assert_allclose(np.exp(1j * (s.phase - r.phase)), 1, atol=0.02)
    assert any("engine orders beyond the tuned sector's" in text for text in both.messages)


def test_statistics_by_the_damper_law_are_checked_in_full(folder):
    """Four wheels, the lowest and the highest also in full; a second call finds them."""
    scene = load_scene(MISTUNED, [*ROUGH_MISTUNED, *ONE_HARMONIC])
    scene = vary(scene, mistuning__level="damper law", mistuning__wheels=4, mistuning__checks=2)
    run = pipeline.run(scene, folder)
    found = scatter_of_run(run)
    assert found.checked.shape == found.whole.shape == (1, 2)
    # the first one checked is the highest by the law
    by_law = found.factor / found.calibration[:, None]
    np.put_along_axis(by_law, found.checked, found.law, axis=1)
    assert found.law[0, 0] == by_law.max()
    assert abs(found.check_errors).max() < 0.05
    assert "solved in full" in " ".join(scatter_sentences(found))
    assert scatter_table(found)["law_error"][0] == abs(found.check_errors).max()
    np.testing.assert_array_equal(scatter_of_run(run).peak, found.peak)


def test_the_damper_law_knows_blades_of_another_shape(folder):
    """Two wide blades, 1 % off in frequency, next to a small scatter: amplification as of the whole
    wheel, which it is not without these blades.
    """
    scene = load_scene(MISTUNED, [*ROUGH_MISTUNED, *ONE_HARMONIC])
    scene = vary(scene, mistuning__level="damper law", mistuning__wheels=3, mistuning__checks=3)
    scene = vary(scene, mistuning__scatter=0.001, mistuning__pattern=None)
    alike = scatter_of_run(pipeline.run(scene, folder))
    entry = "aerofoil.chord_tip = 41 mm"
    scene = vary(scene, mistuning__blades=(f"3: {entry}", f"8: {entry}"))
    found = scatter_of_run(pipeline.run(scene, folder))
    assert abs(found.check_errors).max() < 0.05
    assert (found.factor > 1.03 * alike.factor.max()).all()
    assert set(found.blade.ravel()) <= {2, 7}


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ["mistuning.pattern=nowhere.csv"],
            "mistuning.pattern = .*nowhere.csv': there is no such file",
        ),
        (["disc.sectors=35"], "36 blades, expected 35"),
        (["mistuning.orders=0: 0.3 N"], "expected an order above 0"),
        (["mistuning.orders=100: 0.3 N"], "order 100 is harmonic 100 of the common divisor 1"),
        (
            ["mistuning.orders=18: 0.3 N", "mistuning.level=damper law"],
            "takes one engine order, expected no mistuning.orders",
        ),
        (["mistuning.orders=half: 0.3 N"], "expected a whole order and a force"),
        (["mistuning.orders=13.5: 0.3 N"], "expected a whole order and a force"),
        (
            ["mistuning.blades=37: aerofoil.twist = 21 deg"],
            "'37: .*': expected a blade from 1 to 36",
        ),
        (
            ["mistuning.blades=3: platform.gap = 2 mm"],
            r"'platform.gap', expected one of \[aerofoil\]",
        ),
        (["mistuning.blades=3 aerofoil.twist"], "expected the number of a blade and fields"),
        (["mistuning.blades=3: aerofoil.twist = 210 deg"], "'3: .*': aerofoil.twist = 210 deg"),
        (["mistuning.blades=3: aerofoil.twits = 21 deg"], "'3: .*': .*aerofoil.twist"),
        (
            ["mistuning.blades=3: aerofoil.twist = 21 deg, 3: aerofoil.span = 119 mm"],
            "blade 3 is given twice",
        ),
    ],
)
def test_bad_input_is_refused_before_long_work(overrides, message):
    """What 'bladefem check' calls, and every command before its first stage."""
    with pytest.raises(InputError, match=message):
        refuse_run(load_scene(MISTUNED, overrides))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["1, 0.01"] * 36, "expected blades in order"),
        ([f"{i}, -1.2" for i in range(1, 37)], "-1.2 of blade 1 leaves it no stiffness"),
        ([f"{i}, nan" for i in range(1, 37)], "expected finite numbers"),
        ([f"{i}, 0.01, 0.02" for i in range(1, 37)], "3 columns in blade 1, expected 2"),
    ],
)
def test_bad_pattern_file_is_refused_before_long_work(rows, message, tmp_path):
    file = tmp_path / "pattern.csv"
    file.write_text("\n".join(["blade, 1F", *rows]))
    with pytest.raises(InputError, match=message):
        refuse_run(load_scene(MISTUNED, [f"mistuning.pattern={file}"]))


@pytest.mark.parametrize(
    ("names", "row", "message"),
    [
        ("1F stiffness, 2F stiffness", "0.01, 0.02", "2 families with a stiffness, expected 1"),
        ("mass", "-1.5", "-1.5 of blade 1 leaves it no mass"),
        ("1F, mass", "0.01, 0.02", "expected frequencies alone, or stiffnesses and masses"),
        # a frequency would be another wheel
        ("1F stifness", "0.01", "column '1F stifness'.*did you mean 'stiffness'"),
        ("mass [1], freq", "0.01, 0.02", "expected frequencies alone, or stiffnesses and masses"),
    ],
)
def test_bad_columns_are_refused_before_long_work(names, row, message, tmp_path):
    file = tmp_path / "pattern.csv"
    file.write_text("\n".join([f"blade, {names}", *(f"{i}, {row}" for i in range(1, 37))]))
    with pytest.raises(InputError, match=message):
        refuse_run(load_scene(MISTUNED, [f"mistuning.pattern={file}"]))


def test_scatter_of_several_masses_is_refused_before_long_work():
    scene = load_scene(MISTUNED, ["study.masses=10 g, 20 g"])
    with pytest.raises(InputError, match="study.masses: 2 damper masses, expected one"):
        refuse_scatter(scene)


def test_wheels_that_are_all_alike_are_not_drawn():
    """They took minutes, and every amplification was 1."""
    alike = load_scene(MISTUNED, ["mistuning.scatter=0"])
    with pytest.raises(InputError, match=r"mistuning\.scatter = 0: all wheels .* are alike"):
        refuse_scatter(alike)
    # dampers alone may differ
    refuse_scatter(load_scene(MISTUNED, ["mistuning.scatter=0", "mistuning.load=5 %"]))


def test_scatter_of_a_scene_without_a_wheel_names_its_kind():
    with pytest.raises(InputError, match="a scene of kind 'plane blades' has no wheel"):
        refuse_scatter(load_scene(MISTUNED.with_name("plane.toml")))


@pytest.mark.parametrize(("given", "H"), [(None, 3), (7, 7)])
def test_statistics_begin_with_few_harmonics(given, H):
    """A tuned curve under a light load may need more, unless the scene gives them."""
    scene = load_scene(MISTUNED, ROUGH_MISTUNED)
    scene = vary(scene, model__harmonics=given)
    curve = SimpleNamespace(settings=SimpleNamespace(harmonics=7, samples=64))
    wheel = SimpleNamespace(excitation={1: None})
    assert scatter_balance(scene, wheel, curve) == (H, 64)


def test_the_reported_peak_has_dampers_that_walk(tmp_path):
    """The highest blade, its factor over the tuned wheel and its stress are those of free means,
    and what held ones give stands beside them.
    """
    free_means = [text for text in ROUGH_MISTUNED if not text.startswith("model.static")]
    fixed = [*free_means, "model.harmonics=3", "model.samples=128"]
    run = with_whole_wheel(pipeline.run(load_scene(MISTUNED, fixed), tmp_path))
    (found,) = run.wheel
    free = found.free_means
    assert free.walking == SECTORS and free.points >= 3
    assert 0.005 < free.change < 0.03
    assert found.peak.height == pytest.approx(free.held * (1 + free.change))
    assert found.solution.size().max() == found.peak.height
    assert found.solution.drift.max() == free.speed > 0
    # tuned dampers walk as well: as in the sector's own curve
    assert abs(found.sector_difference) < 2e-3
    assert found.highest.stress.mismatch < 5e-3
    said = [text for text in run.messages if "free mean displacements" in text]
    assert (
        f"{1e6 * free.held:.4g} um" in said[0] and f"{SECTORS} of {SECTORS} dampers walk" in said[0]
    )
    table = pattern_table(run.wheel)
    assert table["highest_amplitude_held"][0] == free.held < table["highest_amplitude"][0]


# Two thirds of the shipped blades, as close to each other and with the same phase between
# neighbours: in a smaller wheel a narrow blade moves with them.
NARROW_WHEEL = (
    *COARSE_MISTUNED,
    "mesh.scale=1.5",
    "disc.sectors=24",
    "disc.bore_radius=80 mm",
    "disc.rim_radius=133.4 mm",
    "excitation.engine_order=6",
    "mistuning.blades=3: aerofoil.chord_tip = 37 mm",
    *ONE_HARMONIC,
)


@pytest.fixture(scope="module")
def narrow_blade(tmp_path_factory):
    """A run with one blade of another shape that is not the highest."""
    scene = vary(load_scene(MISTUNED, NARROW_WHEEL), mistuning__pattern=None)
    with pytest.MonkeyPatch.context() as patch:
        # what more harmonics would change is no question here, and most of the work
        patch.setattr(peak_choice, "judging_balances", lambda *_: [])
        return with_whole_wheel(pipeline.run(scene, tmp_path_factory.mktemp("narrow")))


def test_a_blade_of_another_shape_is_judged_where_it_moves_most(narrow_blade):
    """Against a plain sweep over the band, the stress at its highest point, and Goodman's line."""
    run, scene = narrow_blade, narrow_blade.scene
    (found,) = run.wheel
    highest, odd = found.blades
    assert highest.blade == found.peak.blade != odd.blade == 2 and not found.lost_blades
    assert odd.height < 0.8 * highest.height
    assert abs(odd.frequency / found.frequency - 1) > 5e-3
    bodies, patches = Bodies(scene, run.mesh), list(run.contact.problem.patches)
    (case,) = load_cases(scene, run.mesh, run.contact)
    (curve,) = run.response.curves
    wheel_modes = all_modes(bodies, 6)
    sector = reduce_wheel(bodies, patches, 6, run.clamped, 3, run.modes, root=True)
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, curve.settings)
    deviation = scene_deviations(scene, 24, 3).frequency
    pattern = found.others.added(frequency_pattern(sector.families, deviation), 24)
    points = []
    # odd.frequency is within 0.2 % of the highest, below
    for omega in 2 * np.pi * odd.frequency * np.linspace(0.985, 1.015, 21):
        points.append(
            solve_wheel(wheel, omega, 1, 64, pattern=pattern, start=points[-1] if points else None)
        )
    assert all(point.converged for point in points)
    top = max(points, key=lambda point: point.size()[2])
    # what the search does not look for is 1 %
    assert odd.height == pytest.approx(top.size()[2], rel=0.01)
    assert odd.frequency == pytest.approx(top.frequency, rel=2e-3)
    _, readings = blade_readings(bodies, run.clamped, 3, run.modes, root=True)
    shapes = WheelShapes(bodies, patches, wheel_modes, readings)
    solved = SolvedWheel(shapes, wheel, pattern, case, top, curve.settings.points)
    _, own = odd_blade_stress(run, solved, 2, other_blades(scene, 24)[2])
    assert odd.own_stress.largest == pytest.approx(own.largest, rel=0.01)
    nodes = blade_nodes(own.mesh)
    goodman = own.field / (scene.fatigue.endurance * (1 - own.mean / scene.fatigue.ultimate))
    ((first, second),) = wheel_utilisation(run)
    assert (first.blade, second.blade) == (highest, odd)
    assert second.highest == pytest.approx(goodman[nodes].max(), rel=0.01)
    # that of the wheel's own peak would be another one
    there = abs(found.solution.probe[2, 1, 0])
    assert there < 0.97 * odd.height


def test_the_blade_that_uses_most_is_told(narrow_blade, tmp_path):
    """Though another one moves more: the same run, with more stress in the narrow blade."""
    run = narrow_blade
    (found,) = run.wheel
    highest, odd = found.blades
    own = replace(odd.own_stress, field=10 * odd.own_stress.field)
    run = replace(run, wheel=[replace(found, blades=(highest, replace(odd, own_stress=own)))])
    ((first, second),) = wheel_utilisation(run)
    assert (first.blade.blade, second.blade.blade) == (2, found.peak.blade)
    (worst,) = worst_utilisation(run)
    assert worst.blade == 2 and worst.value == first.highest > second.highest
    assert "blade 3: " in wheel_utilisation_message(run)
    assert pattern_headlines(run.wheel, [worst])[1].what.startswith("utilisation of blade 3")
    tables = utilisation_table(run)
    assert set(tables["wheel/fatigue_of_the_worst_blade"]["blade"]) == {3}
    both = tables["wheel/utilisation_of_the_shapes"]
    assert list(both["blade"]) == [3, found.peak.blade + 1]
    np.testing.assert_array_equal(both["utilisation"], [first.highest, second.highest])
    save_fatigue_vtu(run, tmp_path / "fatigue.vtu")
    assert (tmp_path / "fatigue_of_the_worst_blade.vtu").exists()


def test_blades_are_grouped_by_their_shapes():
    one, other = (BladeChange(k * np.eye(2), np.eye(2), np.zeros(1), np.ones(1)) for k in (1, 2))
    same = replace(one, stiffness=one.stiffness.copy())
    groups = blade_groups(OtherBlades({4: one, 1: other, 0: same}), 6)
    assert [group.tolist() for group in groups] == [[2, 3, 5], [0, 4], [1]]
    assert [group.tolist() for group in blade_groups(None, 2)] == [[0, 1]]
    assert [group.tolist() for group in blade_groups(OtherBlades({0: one, 1: one}), 2)] == [[0, 1]]
