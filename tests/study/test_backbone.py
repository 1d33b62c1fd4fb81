"""The design map of nonlinear modes: closed form of one element, the balance's own resonances and
points, and the command.
"""

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from bladefem.cli.main import main
from bladefem.friction.closed_form import jenkins
from bladefem.hbm.peak import find_peak
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.report.backbone import backbone_sentences, prediction_table
from bladefem.study.backbone import Backbone, curve_backbone

sys.path.insert(0, str(Path(__file__).parents[1] / "hbm"))
from models import single_mass

PLANE = str(Path(__file__).parents[2] / "scenes" / "plane.toml")


def curve_of(height, frequency, harmonics, samples, load=1.0):
    return SimpleNamespace(
        load=load,
        mass=None,
        settings=SimpleNamespace(harmonics=harmonics, samples=samples),
        balance_amplitude=height,
        peak=SimpleNamespace(frequency=frequency),
    )


def test_one_element_in_closed_form():
    """Damping and frequency of a Jenkins element, and the amplitude at which a force meets them."""
    kt, limit = 0.6, 0.5
    model = single_mass(kt, limit)
    found = curve_backbone(model, curve_of(1.0, 1.0, 1, 0), 0, (0.1, 30.0))
    assert found.converged.all()
    law = jenkins(found.amplitude, kt, limit)
    omega = np.sqrt(1 + law.stiffness)
    np.testing.assert_allclose(2 * np.pi * found.frequency, omega, rtol=1e-8)
    np.testing.assert_allclose(found.friction, law.damping / (2 * omega**2), rtol=1e-6, atol=1e-12)
    force = abs(model.loads(1)[1][0])
    height, frequency = found.predicted
    law = jenkins(height, kt, limit)
    omega = 2 * np.pi * frequency
    zeta = law.damping / (2 * omega**2) + np.interp(height, found.amplitude, found.own)
    assert 2 * zeta * omega**2 * height == pytest.approx(force, rel=0.02)


@pytest.mark.parametrize("load", [0.3, 2.0, 8.0])
def test_the_balance_of_the_reference_blade_is_predicted(load):
    """Height and frequency of the resonance, and points on both flanks."""
    model = reference_model(load=load, phase=1.0, points=2, modes=8, harmonics=3)
    peak = find_peak(model, 1.02 * float(model.side(1).omega[0]), 3, 128)
    curve = curve_of(peak.height, peak.omega / (2 * np.pi), 3, 128, load)
    found = curve_backbone(model, curve, 0, (0.03 * peak.height, 3 * peak.height))
    assert found.converged.all()
    assert abs(found.error) < 0.03
    assert found.predicted[1] == pytest.approx(found.balance[1], rel=0.005)
    at, height = found.response()
    assert np.all(np.isfinite(at)) and np.isfinite(height).all()
    for side in (0.985, 1.015):
        point = solve(model, side * peak.omega, 3, 128)
        own = np.linalg.norm(point.probe[1:, 0])
        half = at < found.predicted[1] if side < 1 else at > found.predicted[1]
        order = np.argsort(at[half])
        drawn = np.interp(side * found.balance[1], at[half][order], height[half][order])
        assert drawn == pytest.approx(own, rel=0.1)
    row = prediction_table([found]).iloc[0]
    assert row["off"] == found.error and row["unconverged"] == 0


def test_a_detached_resonance_is_not_taken_for_the_one_from_rest():
    """Friction that opens at large amplitudes: the drive rises through 1, falls and rises again."""
    amplitude = np.geomspace(1e-6, 1e-4, 81)
    x = np.log10(amplitude / 1e-6)
    level = np.full(81, 0.01)
    drive = np.exp(2.0 * np.sin(2 * np.pi * (x - 0.5)) * (x > 0.2) - 0.5 * (x <= 0.2))
    one = Backbone(
        20.0, None, amplitude, 400 + 10 * x, level, 0 * level, drive, level > 0, level < 0,
        (10**-5.5, 405.0), amplitude, "",
    )  # fmt: skip
    (first, second) = one.resonances
    assert first == pytest.approx((10**-5.5, 405.0), rel=1e-4)
    assert second == pytest.approx((10**-4.5, 415.0), rel=1e-4)
    assert abs(one.error) < 1e-3
    at, height = one.response()
    # the second piece stands alone, between x = 1 and 1.5
    (gap,) = np.flatnonzero(np.isnan(at))
    assert height[:gap].max() == pytest.approx(10**-5.5, rel=1e-4)
    assert height[gap + 1 :].min() == pytest.approx(10**-5.0, rel=1e-4)
    assert height[gap + 1] == height[-1]
    assert any(
        "keeps the mode up to 31.62 um (415 Hz)" in said for said in backbone_sentences([one])
    )
    assert prediction_table([one])["detached_amplitude"][0] == pytest.approx(10**-4.5, rel=1e-4)


def test_a_force_that_no_amplitude_meets_is_said():
    found = curve_backbone(single_mass(0.6, 0.5), curve_of(1.0, 1.0, 1, 0), 0, (1e-6, 2e-6))
    assert np.isnan(found.error)
    (_, said) = backbone_sentences([found])
    assert "reaches no resonance" in said and said.level == "warning"


def listed(page):
    """Sentences of a report."""
    return [line for line in page.splitlines() if line.startswith("- ")]


def test_command_writes_the_map_and_finds_it_again(tmp_path, capsys):
    arguments = ["backbone", PLANE, "-o", str(tmp_path), "--set", "mesh.scale=4"]
    arguments += ["--set", "study.loads=20 N", "--set", "study.influences=false"]
    # under the best load, which is studied as well, the damper bounces
    arguments += ["--set", "model.harmonics=1", "--set", "model.samples=64"]
    arguments += ["--set", "contact.points=3"]
    arguments += ["--set", "study.stability=false"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "resonances predicted by the nonlinear mode alone are off by" in printed
    assert "estimated error of the balance [%]" in printed
    for name in ("design_map.png", "backbone.csv", "backbone_resonances.csv"):
        assert (tmp_path / name).is_file()
    # the error of the balance and its warnings stand there, as in the report of the run
    page = (tmp_path / "report_backbone.md").read_text()
    assert re.search(
        r"from the balance; the balance itself: (± [\d.]+ % \(model and mesh\)|error)", page
    )
    assert main(["run", *arguments[1:]]) == 0
    of_run = [one for one in listed((tmp_path / "report.md").read_text()) if "estimated" in one]
    assert any("estimated error of the resonance amplitude exceeds the wanted" in o for o in of_run)
    said = [
        one for one in of_run if "away from the resonance" in one or "exceeds the wanted" in one
    ]
    assert len(said) == 2 and set(said) <= set(listed(page))
    # and on the terminal, as warnings
    shown = printed.split("warnings:\n")[1]
    assert all(one.removeprefix("- ") in shown for one in said)
    by_mode = pd.read_csv(tmp_path / "backbone_resonances.csv").set_index("load [N]")
    of_run = pd.read_csv(tmp_path / "summary.csv").set_index("load [N]")
    assert by_mode["balance_error"][20] == pytest.approx(of_run["error"][20], rel=1e-6)
    # the damping of the mode where the force of the scene drives it, by the decay of the free
    # vibration; full stick, which dissipates nothing, shows what the changed shape does: 6.5 %
    decay = pd.read_csv(tmp_path / "backbone.csv").query("`load [N]` == 20 and converged")
    drive = decay["drive"].to_numpy()
    ratio = (decay["friction_damping"] + decay["own_damping"]).to_numpy()
    first = int(np.argmax(drive > 1))
    there = np.interp(1.0, drive[first - 1 : first + 1], ratio[first - 1 : first + 1])
    ratio = of_run["equivalent_damping"]
    assert ratio[20] == pytest.approx(there, rel=0.1)
    # the error that is told: half of the true one at least
    told = of_run["error"][20] + abs(ratio[np.inf] / ratio[0] - 1)
    assert abs(ratio[20] / there - 1) < 2 * told
    assert main(arguments) == 0
    assert "backbone_20N: found in the folder" in (tmp_path / "report_backbone.html").read_text()
