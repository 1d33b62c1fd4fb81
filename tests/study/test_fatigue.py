"""Haigh's diagram: Goodman's line in closed form, tables, what is refused, the worst places."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from pylife.strength.meanstress import HaighDiagram as FkmDiagram

from bladefem.errors import InputError
from bladefem.fem.stress import signed_von_mises, von_mises
from bladefem.report import fatigue
from bladefem.report.fatigue import save_fatigue_vtu, utilisation_table
from bladefem.report.scatter_sentences import use_headlines, use_sentences
from bladefem.report.scatter_tables import use_table
from bladefem.scene.tables import Fatigue, Scene
from bladefem.scene.toml import vary
from bladefem.study.fatigue import fatigue_utilisation, haigh_diagram
from bladefem.study.mistuning import stage
from bladefem.study.mistuning.scatter_use import scattered_use
from bladefem.study.pipeline.preflight import refuse_run
from bladefem.study.pipeline.utilisation import (
    highest_use,
    highest_wheel_use,
    run_utilisation,
    utilisation_message,
)
from bladefem.wheel.statistics import Amplification

MPA = 1e6
# [N], [m]: the second is the searched one
LOWER_BESIDE = ((73.0, 141e-6), (78.9, 147e-6))
TABLE = ["0 MPa: 300 MPa", "400 MPa: 180 MPa"]


def nodes(count: int) -> np.ndarray:
    """Places on a line of a metre."""
    return np.column_stack([np.linspace(0, 1, count), np.zeros(count), np.zeros(count)])


def test_goodman_line_is_its_closed_form():
    """alternating / endurance + mean / ultimate = 1 at the limit; compression helps nothing."""
    diagram = haigh_diagram(Fatigue(endurance=300 * MPA, ultimate=900 * MPA))
    mean = np.array([-400.0, 0.0, 300.0, 600.0]) * MPA
    alternating = np.array([150.0, 150.0, 200.0, 100.0]) * MPA
    used = fatigue_utilisation(diagram, nodes(4), alternating, mean).used
    assert used == pytest.approx([0.5, 0.5, 1.0, 1.0], rel=1e-12)


def test_table_is_straight_between_its_points():
    table = Fatigue(haigh=("-200 MPa: 350 MPa", "0 MPa: 300 MPa", "0.4 GPa: 180 MPa"))
    diagram = haigh_diagram(table)
    assert diagram.allowed(np.array([-100.0, 200.0]) * MPA) == pytest.approx([325 * MPA, 240 * MPA])
    assert np.isnan(diagram.allowed(np.array([500 * MPA]))).all()
    assert haigh_diagram(Fatigue()) is None


def test_limit_of_the_diagram_is_that_of_pylife():
    """Diagram of the FKM guideline: sensitivity M up to R = 0, M/3 beyond, here up to R = 1/2; pyLife
    brings the amplitudes that last at any mean stress to the endurance limit at R = -1.
    """
    limit, M = 300.0, 0.3
    pressed, pulsed = limit / (1 - M), limit / (1 + M)
    beyond = pulsed * (1 + M / 3) / (1 + M)
    knots = [(-pressed, pressed), (0.0, limit), (pulsed, pulsed), (3 * beyond, beyond)]
    diagram = haigh_diagram(Fatigue(haigh=tuple(f"{x!r} MPa: {y!r} MPa" for x, y in knots)))
    mean = np.linspace(-0.99 * pressed, 2.99 * beyond, 41)
    amplitude = diagram.allowed(mean * MPA) / MPA
    cycles = pd.DataFrame({"range": 2 * amplitude, "mean": mean, "cycles": 1.0})
    goodman = FkmDiagram.fkm_goodman(pd.Series({"M": M}))
    assert goodman.transform(cycles, -1.0)["range"].to_numpy() / 2 == pytest.approx(limit, rel=1e-9)


def test_nothing_lasts_at_the_ultimate_strength():
    diagram = haigh_diagram(Fatigue(endurance=300 * MPA, ultimate=900 * MPA))
    found = fatigue_utilisation(diagram, nodes(2), np.array([1.0, 0.0]), np.full(2, 900 * MPA))
    assert np.isinf(found.used[0])
    assert found.used[1] == 0


def test_worst_places_are_apart():
    """Neighbours of a worse node are the same place; the order is that of the utilisation."""
    count = 1001
    alternating = 100 * MPA * np.exp(-((np.linspace(0, 1, count) - 0.3) ** 2) / 0.02)
    diagram = haigh_diagram(Fatigue(endurance=300 * MPA, ultimate=900 * MPA))
    found = fatigue_utilisation(diagram, nodes(count), alternating, np.zeros(count))
    places = found.worst_places(5)
    assert places[0] == found.worst == 300
    assert np.all(np.diff(found.used[places]) <= 0)
    apart = np.abs(np.subtract.outer(places, places))[np.triu_indices(5, 1)]
    assert apart.min() > 0.01 * count - 1


def test_places_where_nothing_lasts_come_first():
    """A diagram that is zero from 400 MPa on: the table was empty as soon as a node was there."""
    table = ("-400 MPa: 300 MPa", "0 MPa: 300 MPa", "400 MPa: 0 MPa", "800 MPa: 0 MPa")
    scene = vary(Scene(), fatigue__haigh=list(table))
    run = run_of(scene, 600 * MPA)
    (rows,) = utilisation_table(run).values()
    assert rows["x"].tolist() == [0.0, 0.5]
    assert rows["utilisation"].tolist() == [np.inf, pytest.approx(0.1)]
    assert rows["utilisation_bound"].tolist() == [np.inf, pytest.approx(0.1 * 1.2 * 1.1)]


def test_utilisation_of_two_masses_under_one_load(monkeypatch):
    """Rows and fields tell the masses apart; of two fields of one name the first was lost."""
    scene = vary(Scene(), fatigue__endurance="300 MPa", fatigue__ultimate="900 MPa")
    run = run_of(scene, 300 * MPA)
    (curve,) = run.response.curves
    run.response.curves = [
        SimpleNamespace(**{**vars(curve), "mass": mass}) for mass in (0.005, 0.05)
    ]
    run.damped[1] = SimpleNamespace(field=2 * run.damped[0].field, mesh_error=0.1)
    (rows,) = utilisation_table(run).values()
    assert rows.groupby("mass")["utilisation"].max().tolist() == pytest.approx([0.3, 0.6])
    saved = {}
    monkeypatch.setattr(fatigue, "save_vtu", lambda mesh, file, fields: saved.update(fields))
    save_fatigue_vtu(run, None)
    names = [f"utilisation, 80 N of {mass} g [1]" for mass in (5, 50)]
    assert [saved[name].max() for name in names] == pytest.approx([0.3, 0.6])


def test_mean_stress_outside_of_the_diagram_names_the_place():
    diagram = haigh_diagram(Fatigue(haigh=("0 MPa: 300 MPa", "400 MPa: 180 MPa")))
    with pytest.raises(InputError, match=r"450 MPa at \(1000.0, 0.0, 0.0\) mm.*0 Pa to 400 MPa"):
        fatigue_utilisation(diagram, nodes(2), np.ones(2), np.array([100.0, 450.0]) * MPA)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"endurance": "300 MPa"}, "fatigue.ultimate: expected with"),
        ({"ultimate": "300 MPa"}, "fatigue.endurance: expected with"),
        ({"endurance": "900 MPa", "ultimate": "300 MPa"}, "expected at most fatigue.ultimate"),
        ({"endurance": "1 GPa", "haigh": ["0 MPa: 1 MPa", "1 MPa: 1 MPa"]}, "only one of the two"),
        ({"haigh": ["0 MPa: 1 MPa"]}, "1 mean stress, expected at least two"),
        ({"haigh": ["0 MPa", "1 MPa: 1 MPa"]}, "expected mean stress and amplitude"),
        ({"haigh": ["5 MPa: 1 MPa", "1 MPa: 1 MPa"]}, "expected rising mean stresses"),
        ({"haigh": ["0 MPa: 1 MPa", "1 MPa: -1 MPa"]}, "expected none below 0"),
        ({"haigh": ["0 MPa: 1 mm", "1 MPa: 1 MPa"]}, "is not a unit of this field"),
        ({"haigh": ["0 MPa: 300 MPa", "400 MPa: 180"]}, "180 Pa, expected 0, or a size from 100 k"),
    ],
)
def test_diagrams_are_refused_before_long_work(changes, said):
    scene = vary(Scene(), **{f"fatigue__{name}": value for name, value in changes.items()})
    with pytest.raises(InputError, match=said):
        refuse_run(scene)


def run_of(scene: Scene, mean: float) -> SimpleNamespace:
    """A run with one curve: two blade nodes, and one of the damper with a far larger stress."""
    damped = SimpleNamespace(field=np.array([60.0, 30.0, 900.0]) * MPA, mesh_error=0.1)
    curve = SimpleNamespace(
        load=80.0,
        mass=None,
        peak_amplitude=1.0,
        balance_amplitude=1.0,
        over_balance=1.0,
        interval=SimpleNamespace(highest=1.2, lowest=0.9),
    )
    bodies = {"blade": np.array([[0, 1]]), "damper": np.array([[2, 2]])}
    return SimpleNamespace(
        scene=scene,
        mesh=SimpleNamespace(points=nodes(3), bodies=bodies),
        strength=SimpleNamespace(mean=np.array([mean, 0.0, 0.0])),
        damped={0: damped},
        response=SimpleNamespace(curves=[curve], best_curve=0),
        wheel=None,
    )


def test_a_run_knows_its_utilisation_and_its_bound():
    """300 MPa last without mean stress, 200 at 300 of 900: 60 / 200, and 1.2 * 1.1 times that."""
    scene = vary(Scene(), fatigue__endurance="300 MPa", fatigue__ultimate="900 MPa")
    run = run_of(scene, 300 * MPA)
    found = run_utilisation(run)[0]
    assert found.used == pytest.approx([0.3, 0.1], rel=1e-12)
    assert highest_use(run, 0, found) == pytest.approx(0.3 * 1.2 * 1.1, rel=1e-12)
    assert "80 N: 0.3 at (0.0, 0.0, 0.0) mm, 60 MPa over a mean stress of 300 MPa; 0.396" in (
        utilisation_message(run)
    )
    # a march that keeps to more than the balance, whose stresses they are, and than any history
    run.response.curves[0].over_balance = 1.5
    run.response.curves[0].peak_amplitude = 1.5
    marched = run_utilisation(run)[0]
    assert marched.used == pytest.approx([0.45, 0.15], rel=1e-12)
    assert highest_use(run, 0, marched) == pytest.approx(0.45 * 1.1, rel=1e-12)
    # a mistuned wheel is balanced too: the tuned march bounds what it may keep to
    assert highest_wheel_use(run, 0, found, 0.1) == pytest.approx(0.3 * 1.5 * 1.1, rel=1e-12)
    assert run_utilisation(run_of(Scene(), 0.0)) == {}
    assert utilisation_message(run_of(Scene(), 0.0)) == ""


def amplification(factors: np.ndarray) -> Amplification:
    """Wheels of a tuned wheel that moves 1 mm under 80 N; nothing else of them is read."""
    none = np.zeros((1, 0), dtype=int)
    one = np.array([1e-3])
    tall = 1e-3 * factors[None]
    return Amplification(np.array([80.0]), one, one, tall, none, tall, none, none, none, none, none)


def test_the_band_of_the_scatter_enters_the_utilisation():
    """0.3 of the tuned wheel times the quantile of 1000 wheels, even from 1 to 2: 1.95."""
    scene = vary(Scene(), fatigue__endurance="300 MPa", fatigue__ultimate="900 MPa")
    run = run_of(scene, 300 * MPA)
    (used,) = scattered_use(run, amplification(np.linspace(1, 2, 1000)))
    assert used.share.value == pytest.approx(0.3 * 1.95, rel=1e-3)
    # of a binomial count of 1000 with 95 %: 2.5 and 97.5 % are 936 and 963
    assert used.share.low == pytest.approx(0.3 * 1.936, rel=2e-3)
    assert used.share.high == pytest.approx(0.3 * 1.963, rel=2e-3)
    assert used.highest == pytest.approx(used.share.high * 1.2 * 1.1, rel=1e-12)
    assert used.margin == pytest.approx(1 / used.highest)
    assert scattered_use(run_of(Scene(), 0.0), amplification(np.ones(9))) == []


def test_too_few_wheels_leave_the_utilisation_open_above():
    scene = vary(Scene(), fatigue__endurance="300 MPa", fatigue__ultimate="900 MPa")
    (used,) = scattered_use(run_of(scene, 0.0), amplification(np.linspace(1, 2, 20)))
    assert np.isinf(used.highest) and np.isnan(used.margin)
    assert "unknown, too few wheels" in use_sentences([used])[0]
    # zero would be read as no margin
    assert np.isnan(use_table([used])["stress_margin"][0])
    (number,) = use_headlines([used])
    assert number.uncertainty.startswith("upper end unknown, too few wheels, with")


def test_a_diagram_that_is_too_short_is_a_warning_of_the_run():
    message = utilisation_message(run_of(vary(Scene(), fatigue__haigh=TABLE), 500 * MPA))
    assert message.level == "warning"
    assert "the mean stress is 500 MPa at (0.0, 0.0, 0.0) mm" in message


def test_compression_is_negative():
    """Uniaxial stress: its own value with its sign."""
    stress = np.zeros((2, 6))
    stress[:, 0] = 5.0, -5.0
    assert signed_von_mises(stress) == pytest.approx([5.0, -5.0])
    shear = np.array([0, 0, 0, 2.0, 0, 0])
    assert signed_von_mises(shear) == pytest.approx(von_mises(shear))


def test_the_wheel_is_solved_under_the_load_that_the_report_begins_with(monkeypatch):
    """The searched load, also where another one is lower by less than its error: utilisations of
    both wheels stand next to each other.
    """
    curves = [SimpleNamespace(load=load, peak_amplitude=height) for load, height in LOWER_BESIDE]
    run = SimpleNamespace(
        response=SimpleNamespace(curves=curves, best_curve=1),
        scene=Scene(),
        mesh=None,
    )
    monkeypatch.setattr(stage, "Bodies", lambda *_: None)
    monkeypatch.setattr(stage, "_run_deviations", lambda _: SimpleNamespace(of_material=False))

    def asked(run, wanted, *_):
        raise InputError(f"under {wanted[0].load:g} N")

    monkeypatch.setattr(stage, "_kept_sector", asked)
    with pytest.raises(InputError, match="under 78.9 N"):
        stage.with_whole_wheel(run)
