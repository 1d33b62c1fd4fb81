"""The best load is studied like those that were given, and the answer is what its response tells."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from bladefem.report.best_load import best_load_table, found_best
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline import kept_best_load, pipeline, response_stage
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.best_load import BestLoad
from bladefem.study.pipeline.best_load_remarks import best_load_remarks
from bladefem.study.pipeline.kept_best_load import MAX_ROUNDS, study_kept_loads
from bladefem.study.pipeline.loads import Search, StudiedLoads, best_curve, study_loads


def best(load: float, mass: float | None = None, reason: str = "") -> BestLoad:
    """A search that ended at 150 um."""
    return BestLoad(
        mass, load, 382.6, 150e-6, 6e-4, 7e-4, 1e-3, (60.0, 87.0), Settings(10, 3, 64, "rigid", 4, error=0.027),
        np.array([load]), np.array([150e-6]), (0.5, 5e4), 100, reason,
    )  # fmt: skip


def case(load: float, mass: float | None = None) -> LoadCase:
    return LoadCase(load, None, None, mass)


def curve(
    load: float, amplitude: float, mass: float | None = None, unstable: str | None = None
) -> SimpleNamespace:
    return SimpleNamespace(
        load=load,
        mass=mass,
        peak_amplitude=amplitude,
        peak_frequency=386.9,
        error=0.04,
        friction_work=5e-4,
        input_work=6e-4,
        unstable_peak=unstable,
    )


def searches_of(found):
    return [Search(lambda b=b: b, lambda load, b=b: case(load, b.mass)) for b in found]


def studied(cases, found):
    """Curves of the given cases with searches that end at these best loads."""
    return study_loads(
        cases, lambda one: curve(one.load, 1e-6, one.mass), searches=searches_of(found)
    )


def test_a_search_is_told_as_a_search():
    """Its end is the answer only where the judged resonances carry it."""
    (found,) = best_load_remarks(SimpleNamespace(accuracy=0.05), (best(78.9107),))
    assert found.startswith("search for the best load: it ended at 78.91 N; no load near it lowers")
    assert found.detail.startswith("searched between 0.5 N and ") and "model: " in found.detail
    (lost,) = best_load_remarks(SimpleNamespace(accuracy=0.05), (best(1.0, reason="no maximum"),))
    assert lost.startswith("best load: not found between") and lost.endswith("no maximum")


def test_a_best_load_that_was_not_given_takes_its_place():
    found = studied([case(150.0), case(9.0)], [best(78.9107)])
    assert [c.load for c in found.curves] == [9.0, 78.91, 150.0]
    assert [c.load for c in found.cases] == [9.0, 78.91, 150.0]
    assert [b.load for b in found.best] == [78.9107]


def test_each_mass_has_its_own():
    cases = [case(load, mass) for mass in (0.02, 0.01) for load in (9.0, 150.0)]
    found = studied(cases, [best(80.0, 0.02), best(60.0, 0.01)])
    assert [(c.mass, c.load) for c in found.curves] == [
        (0.02, 9.0), (0.02, 80.0), (0.02, 150.0), (0.01, 9.0), (0.01, 60.0), (0.01, 150.0),
    ]  # fmt: skip


@pytest.mark.parametrize("found", [best(78.9107), best(np.nan, reason="no peak")])
def test_nothing_is_added_where_it_was_given_or_not_found(found):
    given = studied([case(9.0), case(78.91)], [found])
    assert [c.load for c in given.curves] == [9.0, 78.91]


def test_the_report_begins_with_the_curve_at_the_best_load():
    """Not with one that happens to be lower: the best load may be off by the search's accuracy."""
    curves = [curve(73.0, 145e-6), curve(78.91, 147e-6), curve(9.0, 2e-3)]
    assert best_curve(curves, [best(78.9107)]) == 1
    assert best_curve(curves, [best(np.nan, reason="no peak")]) == 0
    assert best_curve(curves, []) == 0


def test_a_load_under_which_the_blade_keeps_far_more_is_not_the_best():
    """Plane blades: balances of 2.05 um under 2.547 N, where a strong drive leads to 14.2 um."""
    curves = [curve(2.547, 14.2e-6), curve(3.0, 2.58e-6)]
    assert best_curve(curves, [best(2.547)]) == 1
    (row,) = best_load_table([best(2.547)], curves).to_dict("records")
    assert np.isnan(row["amplitude"]) and row["searched_amplitude"] == 150e-6
    assert "14.2 um under 2.547 N, 2.58 um under 3 N" in row["reason"]
    # as far as its own error tells
    curves[1].error = 3.0
    assert best_curve(curves, [best(2.547)]) == 0
    curves[1].error = None
    assert best_curve(curves, [best(2.547)]) == 0


@pytest.mark.parametrize(("mu", "count"), [("0", 0), ("0.2", 1)])
def test_none_is_sought_without_friction(mu, count):
    """The response depends on the load only where contacts lift off: the wedge's best was 47 kN."""
    scene = load_scene("scenes/wedge.toml", [f"contact.mu={mu}"])
    space, runner = SimpleNamespace(dimension=3), SimpleNamespace(alone=print)
    study = response_stage._Study(scene, space, None, Settings(10, 3, 64, "rigid", 4), runner)
    searches = response_stage._best_load_searches(study, SimpleNamespace(problem=None, rough=None))
    assert len(searches) == count


def test_its_row_is_that_of_its_response():
    """The balance of the shipped wedge is 150 um high there; the blade keeps to 147.5."""
    (row,) = best_load_table([best(78.9107)], [curve(78.91, 147.5e-6)]).to_dict("records")
    assert (row["load"], row["amplitude"], row["frequency"]) == (78.91, 147.5e-6, 386.9)
    assert row["searched_amplitude"] == 150e-6 and row["error"] == 0.04
    (alone,) = best_load_table([best(78.9107)]).to_dict("records")
    assert alone["amplitude"] == alone["searched_amplitude"]


def test_meshes_are_not_counted_twice():
    summary = pd.DataFrame(
        {
            "load": [0.0, 78.91, 150.0, np.inf],
            "peak_amplitude": [1e-3, 147.5e-6, 2e-4, 1e-3],
            "error": [0.0, 0.04, 0.05, 0.0],
            "body_mesh": [0.0, 0.01, 0.02, 0.0],
        }
    )
    table = best_load_table([best(78.9107)], [curve(78.91, 147.5e-6)])
    assert found_best(table, summary)["error"] == 0.04
    elsewhere = found_best(best_load_table([best(78.9107)]), summary.drop(index=1))
    assert elsewhere["error"] == pytest.approx(0.027 + 0.02)


def test_a_run_studies_it(tmp_path):
    """A coarse wedge, not judged in time: the same in curves, pressure maps and stresses."""
    coarse = ["mesh.size=16 mm", "mesh.scale=1.5", "mesh.seat_elements=2", "aerofoil.fillet=0 mm"]
    coarse += ["contact.points=2", "model.modes=6", "model.damper=rigid"]
    # more of them are what this is not about
    coarse += ["model.harmonics=1", "model.samples=64"]
    study = ['loads=["50 N", "200 N"]', "own_load=false", "influences=false", "stability=false"]
    scene = load_scene("scenes/wedge.toml", [*coarse, *(f"study.{one}" for one in study)])
    run = pipeline.run(scene, tmp_path, until="response")
    (found,) = run.response.best
    curves = run.response.curves
    there = curves[run.response.best_curve]
    assert [c.load for c in curves] == sorted({50.0, 200.0, there.load})
    assert there.load == pytest.approx(found.load, rel=1e-3)
    assert list(run.contact.maps) == [c.load for c in curves]
    assert run.damped[run.response.best_curve].load == there.load
    assert there.peak_amplitude == pytest.approx(found.amplitude, rel=2 * scene.accuracy)
    # nothing is computed again
    again = pipeline.run(scene, tmp_path, until="response")
    assert [c.load for c in again.response.curves] == [c.load for c in curves]
    assert again.response.best_found.load == found.load


def test_the_own_load_is_looked_up_for_the_damper_mass_that_makes_it():
    curves = [
        SimpleNamespace(load=load, mass=mass) for mass in (5e-3, 12e-3) for load in (80.0, 120.0)
    ]
    assert response_stage.own_curve(curves, 121.4, 12.6e-3) == 3
    assert response_stage.own_curve(curves, 79.0, 4e-3) == 0
    # the damper's own mass alone
    curves = [SimpleNamespace(load=load, mass=None) for load in (80.0, 121.4, 200.0)]
    assert response_stage.own_curve(curves, 121.4, 12.6e-3) == 1


def kept_amplitude(load: float, lowest: float = 71.0) -> float:
    """Two branches that cross, as those of the shipped wedge: powers of the load [m]."""
    return 140e-6 * max((lowest / load) ** 2.0, (load / lowest) ** 0.6)


def studied_by_kept_motions(loads, found, amplitude=kept_amplitude, unstable="torus"):
    """With these loads given, a search that ended at the best load, and what the blade keeps."""

    def curve_at(one):
        return curve(one.load, amplitude(one.load), one.mass, unstable)

    given = [case(load, found.mass) for load in loads]
    started = StudiedLoads(given, [curve_at(one) for one in given], [found])
    return study_kept_loads(
        started, searches_of([found]), lambda cases: list(map(curve_at, cases)), 0.05
    )


@pytest.mark.parametrize(
    "loads", [(9.0, 36.0, 73.0, 79.68, 121.4), (9.96, 19.9, 39.8, 79.68, 159.4, 318.7)]
)
def test_the_lowest_motion_that_the_blade_keeps_is_the_best(loads):
    """Not the lowest balance: 148 um are kept under the load of the search, 140 under another."""
    found = studied_by_kept_motions(loads, best(79.68))
    (kept,) = [b.kept for b in found.best]
    assert kept_amplitude(kept.load) < 1.025 * kept_amplitude(71.0)
    assert len(found.curves) <= len(loads) + 4
    k = best_curve(found.curves, found.best)
    assert found.curves[k].load == kept.load
    (row,) = best_load_table(found.best, found.curves).to_dict("records")
    assert row["load"] == kept.load and row["amplitude"] == kept_amplitude(kept.load)
    assert row["compared"] == "motions kept" and row["tolerance"] == kept.tolerance
    # the amplitude is within the accuracy in all of the range
    low, high = row["tolerated_from"], row["tolerated_to"]
    assert low < kept.load < high
    assert max(map(kept_amplitude, (low, high))) <= 1.051 * row["amplitude"]


def test_a_wide_gap_beside_the_lowest_is_studied_with_it():
    """Lines through loads so far apart bound little, and the chart's line misses the resonance;
    what is proposed does not depend on last digits.
    """

    def amplitude(load, off=0.0):
        """As measured on the shipped wedge."""
        known = {18.0: 1040.0, 36.0: 610.0, 46.0: 252.0, 52.0: 183.0, 58.0: 160.0, 64.0: 148.0}
        known |= {69.7: 140.2, 73.0: 140.4, 79.68: 148.1, 121.4: 191.3}
        x = np.log(list(known))
        return (1 + off) * 1e-6 * np.exp(np.interp(np.log(load), x, np.log(list(known.values()))))

    found = []
    for off in (-2e-3, 2e-3):

        def of(load, off=off):
            return amplitude(load, off if load < 36 else 0.0)

        ended = studied_by_kept_motions((18.0, 36.0, 73.0, 79.68, 121.4), best(79.68), of)
        found.append([c.load for c in ended.curves])
    assert found[0] == found[1] == [18.0, 36.0, 50.1, 69.7, 73.0, 79.68, 121.4]


def test_what_another_load_may_gain_is_told_with_it():
    found = studied_by_kept_motions((36.0, 73.0, 79.68, 121.4), best(79.68))
    (kept,) = [b.kept for b in found.best]
    assert (
        kept.tolerance >= 0.5 * (kept_amplitude(kept.load) / 140e-6 - 1) and kept.tolerance < 0.02
    )
    remarks = list(best_load_remarks(SimpleNamespace(accuracy=0.05), found.best))
    assert f"those under {kept.load:.4g} N are the lowest" in remarks[1]


def test_balances_that_the_blade_keeps_need_no_further_loads():
    found = studied_by_kept_motions((36.0, 79.68, 159.0), best(79.68), unstable=None)
    assert len(found.curves) == 3 and found.best[0].kept is None


def test_a_resonance_that_falls_to_the_end_of_all_loads_has_no_best():
    """Looked for outwards, and then refused rather than reported."""
    found = studied_by_kept_motions((36.0, 79.68), best(79.68), amplitude=lambda load: 1e-2 / load)
    assert len(found.curves) == 2 + MAX_ROUNDS and found.best[0].kept is None


def test_a_load_whose_resonance_is_hardly_known_is_not_studied_again():
    """A short blade had 21 N three times: proposed between its neighbours, as its own error kept it
    out of the comparison.
    """
    found = best(25.72)
    given = [case(load) for load in (13.0, 17.15, 25.72, 51.0)]

    def curve_at(one):
        new = curve(one.load, kept_amplitude(one.load, 22.0), unstable="torus")
        if one.load not in [c.load for c in given]:
            new.error = 0.21
        return new

    started = StudiedLoads(given, [curve_at(one) for one in given], [found])
    ended = study_kept_loads(
        started, searches_of([found]), lambda cases: list(map(curve_at, cases)), 0.05
    )
    loads = np.array([c.load for c in ended.curves])
    # one where it may be the lowest, one in the wide gap above that
    assert len(loads) == len(given) + 2
    assert np.all(np.diff(loads) / loads[:-1] > 0.02)


def test_resonances_that_are_hardly_known_are_not_compared():
    """The lowest of several would be the one whose highest motion was missed."""
    given = [case(load) for load in (36.0, 79.68, 159.0)]
    curves = [curve(c.load, kept_amplitude(c.load), unstable="torus") for c in given]
    curves[1].error = 0.9
    started = StudiedLoads(given, curves, [best(79.68)])
    assert study_kept_loads(started, searches_of(started.best), None, 0.05) == started


def test_added_loads_stay_in_the_range_of_the_search():
    found = replace(best(70.0), searched=(60.0, 200.0))
    given = [case(load) for load in (10.0, 36.0, 70.0, 80.0, 300.0, 580.0)]
    curves = [curve(c.load, kept_amplitude(c.load, 72.0), unstable="torus") for c in given]
    added = kept_best_load._next_loads(found, curves, 0.05)
    assert added and all(60.0 <= load <= 200.0 for load in added)


def test_an_added_load_beside_one_that_is_studied_keeps_its_side():
    """Three digits of 101.49 N are 101 N, on the other side of 101.2 N."""
    loads = (60.0, 95.0, 101.2, 105.0, 150.0)
    steep = [1e-4 * max((101.5 / load) ** 12.0, (load / 101.5) ** 12.0) for load in loads]
    pairs = zip(loads, steep, strict=True)
    curves = [curve(load, height, unstable="torus") for load, height in pairs]
    added = kept_best_load._next_loads(best(101.2), curves, 0.05)
    assert added[0] == pytest.approx(101.5, abs=0.1)
