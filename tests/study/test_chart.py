"""The chart on the reference blade: known orders of accuracy, known failures, files."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from numba import njit

from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.report import chart as report_chart
from bladefem.report.chart import write_chart
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings, first_for, first_settings, scene_line
from bladefem.study.chart import chart, meshes
from bladefem.study.chart.chart import method_chart
from bladefem.study.chart.cpu_clock import running_clock
from bladefem.study.chart.meshes import mesh_table, mesh_variants
from bladefem.study.chart.methods import (
    Point,
    exact_balance,
    exact_shooting,
    obstacle_in_time,
    tangential_model,
)
from bladefem.study.chart.rows import Bench, Job, chart_rows, parabola_resonance
from bladefem.study.chart.scene import _judged_sentence
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.util.percent import percent
from bladefem.view.chart import draw_errors

PLANE = Path(__file__).parents[2] / "scenes" / "plane.toml"
# for tests of the body's mesh: contacts that stay closed are solved in a tenth of the time
EASY = ("mesh.contact_size=1.2 mm", "contact.normal=prescribed")


@pytest.fixture(scope="module")
def made():
    """With a budget that a slow machine does not use up: 8 s of CPU on one, of 60."""
    family = family_of(reference_model(load=3.0, points=1, modes=8, harmonics=63))
    with pytest.MonkeyPatch.context() as patch:
        # the parabola takes the highest three, and both flanks have one
        patch.setattr(chart, "FREQUENCIES_IN_HALF_WIDTHS", (-3, -0.75, 0, 0.75, 3))
        return method_chart(family, first_for(family.modes), 2, 0.02, 60.0, (1150.0, 1600.0))


class FalseClock:
    """Runs only where it is told to."""

    time = 0.0

    def now(self):
        return self.time


def _bench(run):
    """Nine frequencies round a resonance at 1 rad/s, its reference by the same function."""
    omegas = np.linspace(0.96, 1.04, 9)
    return Bench(
        omegas,
        parabola_resonance(omegas, np.array([run(None, omega, None).first for omega in omegas])),
        {"error": 0.0},
    )


def test_balance_converges_with_harmonics(made):
    error = made.methods.set_index("name")["error_phasor"]
    assert error["H 1"] > 3 * error["H 3"] > 3 * error["H 7"]
    assert error["H 3"] < 1e-3


def test_automatic_choice_is_marked_and_right(made):
    for table in (made.methods, made.models):
        chosen = table[table["chosen"]]
        assert len(chosen) == 1
        assert chosen["error"].iloc[0] < 0.02


def test_poor_models_are_seen(made):
    models = made.models.set_index("name")
    assert models.loc["1 mode", "error"] > 0.1  # mode 2 is studied
    assert any("1 mode: its resonance lies outside" in remark for remark in made.remarks)
    assert any("changed by" in remark for remark in made.remarks)


def test_every_kind_of_method_is_solved(made):
    """Compiled for the first time or not, and whatever was tried before it."""
    table = made.methods[made.methods["converged"]]
    assert {f"H {H}" for H in (1, 3, 5, 7, 9, 15, 31)} <= set(table["name"])
    assert (
        set(made.methods["family"])
        == set(table["family"])
        >= {
            "paper's iteration",
            "integration, Newmark",
            "integration, explicit",
            "shooting",
            "balance, exact events",
        }
    )


def test_compilation_is_nobodys_time():
    """A kernel that takes long to compile and nothing to run, with a budget of less than the
    former.
    """

    @njit
    def kernel(x):
        return np.full(3, x).sum() + x

    def run(model, omega, start):
        return Point(1 / (0.02j + kernel(omega) / 4 - 1), True, "")

    bench = _bench(lambda model, omega, start: Point(1 / (0.02j + omega - 1), True, ""))
    begun = time.process_time()
    with running_clock() as clock:
        (row,) = chart_rows(
            [Job("slow to compile", "new", None, run, bench)], clock.now() + 0.1, clock
        )
    spent = time.process_time() - begun
    assert row["converged"] and row["error"] < 1e-12
    assert clock.compiled > 0.9 * spent > 10 * row["time"]


def test_the_budget_is_used_and_cheap_ones_go_first():
    """By a false clock: of a dear family only what fits, though it comes first; a cheap one's
    failure bars nobody.
    """
    clock = FalseClock()

    def costing(seconds, converged=True):
        def run(model, omega, start):
            clock.time += seconds
            return Point(1 / (0.02j + omega - 1), converged, "" if converged else "lost")

        return run

    costs = {
        "dear 1": 1.0,
        "dear 2": 2.0,
        "dear 3": 8.0,
        "cheap 1": 0.01,
        "lost 1": 0.1,
        "lost 2": 0.2,
    }
    jobs = [
        Job(name, name[:-2], None, costing(s, name != "lost 1"), _bench(costing(s)), ordered=True)
        for name, s in costs.items()
    ]
    clock.time = 0.0
    table = pd.DataFrame(chart_rows(jobs, 50.0, clock)).set_index("name")
    assert list(table.index) == list(costs)
    assert list(table.index[table["converged"]]) == ["dear 1", "dear 2", "cheap 1", "lost 2"]
    assert list(table.index[table["left_out"]]) == ["dear 3"]
    assert clock.time < 60.0


def test_files_are_written(made, tmp_path):
    files = write_chart(made, tmp_path, 0.02, "reference blade")
    assert all(file.stat().st_size > 100 for file in files)
    assert len(pd.read_csv(files[0])) == len(made.methods)
    page = (tmp_path / "report_chart.html").read_text(encoding="utf-8")
    assert "<h1>reference blade</h1>" in page and "built-in model, speed against" in page
    # it has no fields, which would be those of another scene
    assert 'id="inputs"' not in page and "SHA-256" not in page and "plane" not in page


def test_the_page_begins_with_the_whole_model_and_its_errors_are_no_estimates(
    made, tmp_path, monkeypatch
):
    # the pictures are those of the test above
    for draw in ("draw_chart", "draw_errors"):
        monkeypatch.setattr(
            report_chart, draw, lambda tables, file, **_: plt.imsave(file, np.zeros((2, 2)))
        )
    scene = load_scene(PLANE)
    files = write_chart(made, tmp_path, scene.accuracy, scene.title, scene)
    page = files[-1].read_text(encoding="utf-8")
    row = made.models[made.models["chosen"].astype(bool)].iloc[0]
    first = next(line for line in page.splitlines() if line.startswith("- "))
    assert first.startswith("- automatic choice, whole model: **")
    assert f"**{percent(row['error'])} error**, against the reference of the models" in first
    assert "its harmonics and samples alone, on the model of the methods" in page
    assert "error against the reference [%] | error of the frequency [%]" in page
    assert "error of the worst phasor [%]" in page and "error of the reference [%]" in page
    assert "estimated error [%]" not in page


def test_a_reference_says_how_its_resonance_is_read(made):
    said = [remark for remark in made.remarks if remark.startswith("reference of the models")]
    assert "by the parabola through the highest three frequencies" in said[0]


def test_a_flat_top_is_told_apart_from_the_vertex_that_errors_compare(made, monkeypatch):
    judged = SimpleNamespace(
        march_replaces_balance=False,
        strong_drive_skipped=False,
        march=None,
        marks=SimpleNamespace(verdict=np.full(len(made.curve.points), "stable")),
    )
    monkeypatch.setattr("bladefem.study.chart.scene.judged_resonance", lambda *_: judged)
    said = _judged_sentence(None, None, made.curve)
    top = max((p for p in made.curve.points if p.converged), key=size)
    assert said.startswith("the highest point solved with the automatic choice, ")
    assert f"{top.frequency:.5g} Hz (errors compare vertices of parabolas " in said
    assert said.endswith("is stable")


def test_names_of_axes_fit_and_each_row_has_one_legend(made):
    """A table without phasors leaves its third place to the legend."""
    figure = draw_errors(
        {"methods": made.methods, "meshes": made.models.drop(columns="error_phasor")},
        title="x" * 60,
    )
    figure.draw_without_rendering()
    assert sum(ax.get_legend() is not None for ax in figure.axes) == 2
    assert figure.axes[5].get_legend() is not None
    page = figure.bbox
    for ax in figure.axes[:5]:
        name = ax.yaxis.label.get_window_extent()
        assert page.y0 <= name.y0 and name.y1 <= page.y1 and page.x0 <= name.x0
    plt.close(figure)


def test_exact_events_and_shooting_agree_with_the_balance():
    """Shooting has no truncation, the balance of 15 harmonics 2e-6 of it; stiff modes are
    quasi-static to 1e-3.
    """
    model = tangential_model(reference_model(load=3.0, points=1, modes=8, harmonics=15))
    omega = 2 * np.pi * 1340.0
    balance = solve(model, omega, 15, 4096).probe[1, 0]
    assert exact_balance(15)(model, omega, None).first == pytest.approx(balance, rel=1e-5)
    assert exact_shooting(model, omega, None).first == pytest.approx(balance, rel=1e-4)


def test_the_line_to_take_makes_a_scene_run_with_these_settings(tmp_path):
    taken = Settings(12, 7, 256, "elastic")
    file = tmp_path / "taken.toml"
    file.write_text(f"{scene_line(taken)}\n{PLANE.read_text()}")
    read = first_settings(load_scene(file))
    same = ("modes", "harmonics", "samples", "damper")
    assert all(getattr(read, name) == getattr(taken, name) for name in same)
    assert read.chosen == ("points",)
    assert "points = 4 under [contact]" in scene_line(Settings(12, 7, 256, "elastic", 4))


def test_methods_in_time_refuse_what_they_cannot_do():
    assert obstacle_in_time(reference_model(phase=1.0)) == "blades are not in phase"
    assert obstacle_in_time(reference_model()) == ""


def test_resonance_of_one_mode_is_exact():
    """1/amplitude^2 of a weakly damped oscillator is a parabola in omega^2."""
    omega = np.linspace(0.97, 1.03, 7)
    first = 1 / (1 - omega**2 + 0.02j)
    peak = parabola_resonance(omega, first)
    assert peak.frequency * 2 * np.pi == pytest.approx(1.0, rel=1e-9)
    assert peak.amplitude == pytest.approx(50.0, rel=1e-9)


def test_meshes_of_second_order_agree_and_those_of_first_do_not():
    """Plane blade in bending: 12 and 8 mm differ by 1 % of the frequency, linear triangles are far
    too stiff.
    """
    scene, remarks = load_scene(PLANE, [*EASY, "mesh.size=8 mm"]), []
    variants = mesh_variants(scene, [0.012, 0.008], build_mesh(scene))
    table = mesh_table(scene, Settings(10, 1, 64, "rigid", 4), 40.0, variants, 300.0, remarks)
    rows = table.set_index(["family", "name"])
    assert list(rows.index) == [
        (order, size) for order in ("order 1", "order 2") for size in ("12 mm", "8 mm")
    ]
    assert rows.loc[("order 2", "8 mm"), "error_frequency"] == 0.0
    assert rows.loc[("order 2", "12 mm"), "error_frequency"] < 0.02
    assert rows.loc["order 1", "error_frequency"].min() > 0.05
    assert "8 mm of second order" in remarks[0]


def test_a_mesh_that_would_take_too_long_is_left_out_and_named():
    scene, remarks = load_scene(PLANE, [*EASY, "mesh.size=12 mm"]), []
    variants = mesh_variants(scene, [0.012, 1e-4], build_mesh(scene))
    table = mesh_table(scene, Settings(10, 1, 64, "rigid", 4), 40.0, variants, 200.0, remarks)
    assert table["left_out"].tolist() == [False, True, False, True]
    assert sum("0.1 mm: left out" in remark for remark in remarks) == 2
    assert any("mesh of second order, 0.1 mm: left out" in remark for remark in remarks)
    # what alone is the reference is not exact, and what was left out has no size
    assert "the only one, whose own error is not known" in remarks[0]
    assert np.isnan(table["error"][2]) and table["error"][0] > 0 and np.isnan(table["dofs"][1])


def test_no_mesh_of_second_order_is_no_comparison(monkeypatch):
    """The first mesh takes the whole budget: it was solved, and nothing is said against it."""
    clock = iter([0.0, 0.0, *[9.0] * 99])
    monkeypatch.setattr(meshes.time, "process_time", lambda: next(clock))
    monkeypatch.setattr(meshes, "on_mesh", lambda *_: meshes.MeshResonance(100.0, 1e-5, 80, 9.0))
    scene, remarks = load_scene(PLANE, [*EASY, "mesh.size=12 mm"]), []
    variants = mesh_variants(scene, [0.012, 0.008], build_mesh(scene))
    assert mesh_table(scene, Settings(10, 1, 64, "rigid", 4), 40.0, variants, 5.0, remarks).empty
    assert remarks == [
        "meshes are not compared: none of second order was solved, the reference of the others",
        *(
            f"mesh of {order} order, {size}: left out: the budget was used up"
            for order, size in (("first", "8 mm"), ("second", "12 mm"), ("second", "8 mm"))
        ),
    ]


@pytest.mark.parametrize(
    "given", [[], ["mesh.size=4 mm", "mesh.contact_size=1.2 mm", "mesh.scale=0.6"]]
)
def test_seats_are_refined_with_the_mesh_and_at_last_alone(given):
    """Edges on the seats shrink as much as those of the body, also where a size is left open."""
    scene = load_scene(PLANE, given)
    drawn = build_mesh(scene)
    counts = [
        len(build_mesh(v.of(scene)).faces["seat_right"])
        for v in mesh_variants(scene, [], drawn)
        if v.order == 2
    ]
    own = len(drawn.faces["seat_right"])
    assert counts[2:] == [own, 2 * own]
    assert counts[:2] == pytest.approx([own / 1.7, own / 1.3], abs=1.0)
    coarse, fine = (
        len(build_mesh(v.of(scene)).faces["seat_right"])
        for v in mesh_variants(scene, [0.008, 0.004], drawn)
        if v.order == 2
    )
    assert fine == pytest.approx(2 * coarse, abs=1)


def test_the_halved_seats_show_what_the_contact_mesh_is_wrong():
    """Soft contacts on rigid faces, partly lifted off: with ten elements on a seat the amplitude is
    25 to 30 % low. With one interface law the whole seat presses, and nothing is wrong.
    """
    scene = load_scene(
        PLANE,
        [
            "contact.kt=1e6 N/m",
            "contact.normal=prescribed",
            "contact.stiffness=map",
            "study.band=1100 Hz, 1260 Hz",
            "mesh.size=4 mm",
            "mesh.contact_size=1.2 mm",
        ],
    )
    drawn, remarks = build_mesh(scene), []
    variants = [v for v in mesh_variants(scene, [], drawn) if v.order == 2][2:]
    table = mesh_table(scene, Settings(10, 1, 64, "rigid"), 63.0, variants, 300.0, remarks)
    assert table["chosen"].tolist() == [True, False]
    assert table["error"].iloc[0] > 0.1
