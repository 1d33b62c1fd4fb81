"""A scene's flow: the same in the tuned sector, in the whole wheel and in the finite elements; the
limit cycle of fed waves against the balance; bad input.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from mistuned import COARSE_MISTUNED, MISTUNED

from bladefem.errors import InputError
from bladefem.hbm.solve import solve
from bladefem.report.flow import flow_drawing, flow_headlines, flow_tables
from bladefem.scene.aerodynamics import refuse_flow, wave_influence
from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.family import family_member
from bladefem.study.mistuning.blade_stress import SolvedWheel, WheelShapes, all_modes, blade_motion
from bladefem.study.mistuning.whole_wheel import blade_readings, reduce_wheel, whole_wheel
from bladefem.study.modes.campbell import _excited_waves as excited_waves
from bladefem.study.pipeline import flutter as subject
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import family_of_case, load_cases
from bladefem.study.pipeline.coriolis import has_coriolis, with_coriolis
from bladefem.study.pipeline.damped_motion import SolvedPoint, damped_motion
from bladefem.study.pipeline.flow import scene_flow
from bladefem.study.pipeline.seated_loads import seat_at_loads
from bladefem.study.pipeline.stage_runner import StageClock, StageRunner
from bladefem.wheel.model import frequency_pattern
from bladefem.wheel.solve import solve_wheel

# waves of ten nodal diameters that run with the rotation are fed, those of the engine order are damped
INFLUENCE = ("0: 0.05 %; 90 deg", "1: 0.15 %; 20 deg", "-1: 0.12 %; 200 deg")
COUNT = 36


@pytest.fixture(scope="module")
def reduced():
    scene = load_scene(MISTUNED, [*COARSE_MISTUNED, "mesh.scale=1.5"])
    run = pipeline.run(scene, None, until="reduction")
    scene = vary(scene, aerodynamics__influence=list(INFLUENCE))
    return replace(run, scene=scene)


@pytest.mark.parametrize("finest", [2, None])
def test_flow_of_sector_wheel_and_finite_elements_is_one(reduced, finest):
    """Damped waves of the engine order; every blade of the wheel moves as the sector, and so does
    the model that limit cycles are found with; the points of the scene, and those joined from all
    nodes.
    """
    scene = vary(reduced.scene, contact__points=finest)
    patches = list(reduced.contact.problem.patches)
    bodies = Bodies(scene, reduced.mesh)
    (case,) = load_cases(scene, reduced.mesh, reduced.contact)
    settings = replace(reduced.settings, points=None if finest else 4)
    family = family_of_case(scene, reduced.mesh, reduced.reduced, patches, case)
    model = family_member(family, settings).model
    omega = 1.02 * model.side(1).omega[0]
    one = solve(model, omega, 1, 72)
    flow = scene_flow(scene, COUNT)
    own = replace(reduced, scene=scene, settings=settings)
    waved = subject._wave_model(own, reduced.reduced, patches, case, flow, 9, 0)
    same = solve(waved, omega, 1, 72)
    np.testing.assert_allclose(same.probe, one.probe, atol=1e-7 * abs(one.probe).max())
    sector = reduce_wheel(bodies, patches, settings.modes, reduced.clamped, 3)
    wheel = whole_wheel(scene, reduced.mesh, sector, patches, case, settings)
    found = solve_wheel(wheel, omega, 1, 72)
    assert one.converged and found.converged
    turn = np.exp(2j * np.pi * 9 / COUNT * np.arange(COUNT))
    scale = abs(one.probe).max()
    np.testing.assert_allclose(found.probe[:, 1, 0], one.probe[1, 0] * turn, atol=1e-7 * scale)
    point = SolvedPoint(case, one, settings.points)
    motion = damped_motion(bodies, patches, reduced.modes, point)
    assert motion.mismatch < 2e-3
    # the flow is felt, and without it the finite elements would move otherwise
    still = Bodies(vary(scene, aerodynamics__influence=None), reduced.mesh)
    other = damped_motion(still, patches, reduced.modes, point)
    assert other.mismatch > 5 * motion.mismatch
    pattern = frequency_pattern(sector.families, np.zeros((COUNT, 3)))
    _, readings = blade_readings(bodies, reduced.clamped, 3)
    shapes = WheelShapes(bodies, patches, all_modes(bodies), readings)
    solved = SolvedWheel(shapes, wheel, pattern, case, found, settings.points)
    blade = blade_motion(solved, 5)
    assert blade.mismatch < 2e-3


@pytest.mark.parametrize("order", [1, 5, 17, 18, 19, 31, 36, 40])
def test_waves_are_called_as_in_campbell_diagrams(order):
    """Blades are counted in the sense of the rotation: a wave whose crest comes to the next blade
    later runs forward. The wave of an engine order has one name in flow and Campbell diagram.
    """
    diameters = subject.FlutterResult(*np.zeros((3, COUNT)), ()).diameters
    wave = int(diameters[order % COUNT])
    blades = np.arange(COUNT)
    turn = 2 * np.pi * order * blades / COUNT
    # delay of the crest at the next blade, in turns of the phase, between -1/2 and 1/2
    delay = (-(turn[1] - turn[0]) / (2 * np.pi) + 0.5) % 1.0 - 0.5
    sense = "standing" if 2 * order % COUNT == 0 else "forward" if delay > 0 else "backward"
    assert subject.wave_words(wave, COUNT).endswith(sense)
    table = pd.DataFrame({"frequency": [0.0], "forward": [1.0], "backward": [2.0]})
    (excited,) = excited_waves(table, order, COUNT)["frequency"]
    assert sense == "standing" or excited == {"forward": 1.0, "backward": 2.0}[sense]


@pytest.mark.parametrize("coriolis", [False, True])
def test_limit_cycle_is_where_the_balance_ends_without_force(reduced, coriolis):
    """The resonance of fed waves under less and less force tends to the limit cycle."""
    reduced = replace(reduced, scene=vary(reduced.scene, operation__coriolis=coriolis))
    patches = list(reduced.contact.problem.patches)
    keep = StageRunner(None, None, StageClock({}, []))
    found = subject.find_flutter(reduced, Bodies(reduced.scene, reduced.mesh), patches, keep)
    waves = wave_influence(reduced.scene, COUNT)
    np.testing.assert_allclose(found.net_damping, 1e-3 + waves.imag)
    assert [one.wave for one in found.held] == found.fed
    assert (
        sorted(found.fed) == sorted(found.diameters[found.net_damping < 0]) and len(found.fed) > 5
    )
    (largest,) = found.largest_cycles
    assert largest.amplitude == max(one.amplitude for one in found.held)
    held = found.held[0]
    assert held.wave == found.worst
    assert found.net_damping.min() < 0 < found.net_damping[9]
    assert 0 < held.amplitude < held.stability_limit
    flow = scene_flow(reduced.scene, COUNT)
    wanted = sorted({0, 9, abs(held.wave), abs(largest.wave)})
    sector = subject.reduce_sector(
        Bodies(reduced.scene, reduced.mesh), patches, wanted, reduced.settings.modes
    )
    sector = with_coriolis(reduced.scene, sector)
    assert has_coriolis(sector) == coriolis
    (case,) = load_cases(reduced.scene, reduced.mesh, reduced.contact)
    for one in (held, largest):
        model = subject._wave_model(reduced, sector, patches, case, flow, one.wave, 0)
        last = None
        for force in (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005):
            driven = replace(model, excitation={1: np.array([force])})
            last = solve(driven, 2 * np.pi * one.frequency, 1, 128, start=last)
            assert last.converged
        assert abs(last.probe[1, 0]) == pytest.approx(one.amplitude, rel=0.02)
    said = subject.flutter_sentences(found)
    assert "waves flutter without dampers" in said[0] and "limit cycle" in said[1]
    one_wave = np.where(found.diameters == held.wave, found.net_damping, 1.0)
    alone = subject.flutter_sentences(replace(found, net_damping=one_wave, held=(held,)))
    assert alone[0].startswith("flow: 1 wave flutters without dampers")
    shown = replace(reduced, flutter=found)
    tables = flow_tables(shown)
    assert len(tables["response/flow"]) == COUNT
    assert tables["response/flutter"]["limit_cycle"][0] == held.amplitude
    assert list(tables["response/flutter"]["nodal_diameter"]) == found.fed
    assert len(flow_headlines(shown)) == len(flow_drawing(shown)) == 1


def test_flutter_is_told_under_the_best_load_that_a_search_found(reduced, monkeypatch):
    """By a factor on what is known; where friction does not hold it, by a message."""
    clock = StageClock({}, [])
    keep = StageRunner(None, None, clock)
    (case,) = load_cases(reduced.scene, reduced.mesh, reduced.contact)
    best = 1.5 * case.load
    contact = seat_at_loads(reduced.scene, reduced.contact, [case.load, best], clock)
    curve = SimpleNamespace(load=best, mass=None)
    response = SimpleNamespace(curves=[curve], best_curve=0)
    run = SimpleNamespace(
        scene=reduced.scene,
        mesh=reduced.mesh,
        contact=contact,
        reduced=reduced.reduced,
        settings=reduced.settings,
        response=response,
    )
    held = subject.HeldFlutter(case.load, None, -10, 2e-6, 380.0, 3e-3, 0.01)
    net = np.array([1e-3, -1e-3])
    found = subject.FlutterResult(0 * net, net - 1e-3, net, (held,))
    both = subject.with_best_load(found, run, None, [], keep).held
    assert both[0] == held
    assert both[1].load == best and both[1].amplitude == pytest.approx(3e-6, rel=1e-6)
    # nothing to add where it was asked for
    curve.load = case.load
    assert subject.with_best_load(found, run, None, [], keep) is found
    curve.load = best

    def refused(*_):
        raise InputError("waves: flutter, no limit cycle")

    monkeypatch.setattr(subject, "_by_scale", lambda *_: None)
    monkeypatch.setattr(subject, "_held_anew", refused)
    assert subject.with_best_load(found, run, None, [], keep) is found
    assert "best load" in clock.messages[-1] and "no limit cycle" in clock.messages[-1]


def test_limit_cycles_of_other_loads_are_scaled(reduced):
    """Twice the normal load, twice the limit cycle: as solved anew; not where anything else
    differs.
    """
    patches = list(reduced.contact.problem.patches)
    (case,) = load_cases(reduced.scene, reduced.mesh, reduced.contact)
    e = case.elements
    twice = replace(e, n0=2 * e.n0, t0=2 * e.traction)
    other = replace(case, load=2 * case.load, elements=twice)
    flow = scene_flow(reduced.scene, COUNT)
    sector = subject.reduce_sector(
        Bodies(reduced.scene, reduced.mesh), patches, [0, 9, 10], reduced.settings.modes
    )
    first, direct = (
        subject._held(reduced, sector, patches, one, flow, -10) for one in (case, other)
    )
    (scaled,) = subject._by_scale(other, [(case, [first])])
    fields = ("load", "amplitude", "frequency", "stability_limit", "largest_friction_damping")
    for name in fields:
        assert getattr(scaled, name) == pytest.approx(getattr(direct, name), rel=1e-6)
    assert scaled.amplitude == pytest.approx(2 * first.amplitude)
    stiffer = replace(other, elements=replace(twice, kt=1.1 * e.kt))
    skewed = replace(other, elements=replace(twice, n0=twice.n0 * np.linspace(0.9, 1, len(e.n0))))
    for one in (stiffer, skewed, replace(other, mass=0.01)):
        assert subject._by_scale(one, [(case, [first])]) is None


def test_flutter_that_no_friction_holds_is_one_sentence(reduced):
    patches = list(reduced.contact.problem.patches)
    keep = StageRunner(None, None, StageClock({}, []))
    strong = vary(reduced.scene, aerodynamics__influence=None)
    strong = vary(strong, aerodynamics__waves=["9: 1 %", "-10: -9 %"])
    with pytest.raises(InputError, match=r"waves of -10 nodal diameters under 80 N: .*flutter"):
        subject.find_flutter(
            replace(reduced, scene=strong), Bodies(strong, reduced.mesh), patches, keep
        )


def test_waves_and_coefficients():
    scene = load_scene(MISTUNED)
    scene = vary(scene, aerodynamics__waves=["0: 0.4 %; 0.1 %", "18: -0.2 %"])
    waves = wave_influence(scene, COUNT)
    assert waves[0] == pytest.approx(0.001 + 0.004j) and waves[18] == pytest.approx(-0.002j)
    # linear round the wheel, the same both ways
    assert waves[9] == pytest.approx(0.0005 + 0.001j) and waves[27] == pytest.approx(waves[9])
    scene = vary(scene, aerodynamics__waves=None)
    scene = vary(scene, aerodynamics__influence=["1: 1 %; 90 deg"])
    waves = wave_influence(scene, COUNT)
    # a neighbour's motion damps waves that lead it by nothing, and feeds those in antiphase
    assert waves[0].imag == pytest.approx(0.01) and waves[18].imag == pytest.approx(-0.01)
    assert waves[9].real == pytest.approx(-0.01)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["aerodynamics.waves=9: -0.3 %"], "excitation.engine_order = 9 have -0.2 %"),
        (["aerodynamics.waves=30.5: 1 %"], "expected a whole number and two values"),
        (["aerodynamics.waves=40: 1 %"], "expected a nodal diameter from -18 to 36"),
        (["aerodynamics.waves=5: 1 furlong"], "aerodynamics.waves '5: 1 furlong'"),
        (["aerodynamics.influence=19: 1 %; 0 deg"], "a distance of half the wheel at most"),
        (
            ["aerodynamics.influence=1: 1 %", "aerodynamics.waves=1: 1 %"],
            "either the waves or the influence",
        ),
        (["aerodynamics.waves=9: 1 %", "model.reduction=craig-bampton"], 'expected "rubin"'),
    ],
)
def test_bad_flow_is_refused_before_long_work(overrides, message):
    with pytest.raises(InputError, match=message):
        refuse_flow(load_scene(MISTUNED, overrides))
