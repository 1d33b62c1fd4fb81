"""Hertz and punch scenes from the file to the run folder, against closed forms."""

import re

import numpy as np
import pandas as pd
import pytest

from bladefem.cli.main import main
from bladefem.errors import InputError
from bladefem.io.stage_cache import read_results
from bladefem.scene.toml import load_scene, vary
from bladefem.scene.units import parse
from bladefem.study.kinds.contact_pairs import solve_pair
from bladefem.study.kinds.hertz import _check_load, hertz_load, hertz_radius

HERTZ = load_scene("scenes/hertz.toml")
CYLINDER = load_scene(
    "scenes/hertz.toml", ["hertz.dimension=2", "mesh.contact_size=50 um", "study.loads=auto"]
)


def test_a_sphere_is_pressed_as_hertz_says():
    """h = a/5: pressure 3.3 % (L2), in the middle 0.5 %, radius 0.3 %; blocks of ten radii only:
    -5.5 % approach.
    """
    _, (state,) = solve_pair(vary(HERTZ, mesh__contact_size=2e-4))
    middle = np.argmin(np.linalg.norm(state.seat.patch.points, axis=1))
    assert state.error < 0.04 and state.seat.complementarity < 1e-9
    assert state.seat.pressure[middle] == pytest.approx(state.exact[middle], rel=0.01)
    assert state.radius[0] == pytest.approx(state.radius[1], rel=0.01)
    assert state.approach[0] == pytest.approx(state.approach[1], rel=0.08)


def test_cylinder_is_in_plane_strain():
    """h = a/20: pressure 0.7 % (L2), half width -0.3 %; in plane stress, E* = E/2, it would be 4.8
    % less.
    """
    _, (state,) = solve_pair(CYLINDER)
    E, nu = CYLINDER.material.blade.E, CYLINDER.material.blade.nu
    closed = np.sqrt(8 * state.load * CYLINDER.hertz.radius * (1 - nu**2) / (np.pi * E))
    assert state.radius[1] == pytest.approx(closed) == pytest.approx(CYLINDER.hertz.contact_radius)
    assert state.radius[0] == pytest.approx(closed, rel=0.01)
    assert state.error < 0.02


@pytest.mark.parametrize("dimension", [2, 3])
def test_load_and_radius_belong_together(dimension):
    scene = vary(HERTZ, hertz__dimension=dimension)
    assert hertz_radius(scene, hertz_load(scene, 3e-4)) == pytest.approx(3e-4)


def test_loads_that_the_mesh_cannot_show_are_refused():
    for load in (1.0, 1e5):
        with pytest.raises(
            InputError, match=r"study\.loads = .*made for 24\.6\d* N to 17\.9\d* kN"
        ):
            solve_pair(vary(HERTZ, study__loads=(load,)))
    # elements of 0.8 mm, two of which are wider than the contact
    with pytest.raises(InputError, match=r"study\.loads = .*made for 12\.\d* kN to 17\.9\d* kN"):
        solve_pair(vary(HERTZ, mesh__contact_size=1e-4, mesh__scale=8.0))
    # elements of 5 mm: as wide as the body, which told of "3.08 MN to 17.9 kN"
    with pytest.raises(InputError, match=r"contact_radius = 1 mm: too small for elements of 5 mm"):
        solve_pair(vary(HERTZ, mesh__contact_size=1e-4, mesh__scale=50.0))
    with pytest.raises(InputError, match="expected hertz or punch"):
        solve_pair(load_scene("scenes/plane.toml"))


def test_the_ends_of_the_range_that_a_message_names_are_taken():
    """Over random radii and element sizes, the loads and the element size copied out."""
    rng = np.random.default_rng(4)
    for radius, size in rng.uniform([0.9e-3, 8e-5], [1.1e-3, 2e-4], (60, 2)):
        scene = vary(HERTZ, hertz__contact_radius=radius, mesh__contact_size=size)
        with pytest.raises(InputError) as refused:
            _check_load(scene, 1e-3)
        for end in re.search(r"made for (\S+ k?N) to (\S+ k?N)", str(refused.value)).groups():
            _check_load(scene, parse(end, "N"))
        coarse = vary(scene, mesh__scale=50.0)
        with pytest.raises(InputError) as refused:
            _check_load(coarse, 1e3)
        largest = parse(re.search(r"expected at most (\S+ [mu]m)", str(refused.value))[1], "m")
        # the only load that is left is that of the largest radius
        _check_load(vary(scene, mesh__contact_size=largest), hertz_load(scene, 1.8 * radius))


@pytest.mark.parametrize("kind", ["hertz", "punch"])
def test_an_interference_gives_the_load_that_gives_it(kind):
    """Far faces held closer by the approach of a load carry that load and the same pressure: the
    problem turned.
    """
    base = ["mesh.contact_size=0.2 mm", f"{kind}.dimension=2"]
    scene = load_scene(
        f"scenes/{kind}.toml",
        [*base, "study.loads=1 MN" if kind == "hertz" else "study.loads=3 kN"],
    )
    _, (pressed,) = solve_pair(scene)
    held = [*base, "study.loads=auto", f"{kind}.interference={pressed.approach[0]!r}"]
    _, (state,) = solve_pair(load_scene(f"scenes/{kind}.toml", held))
    assert state.load == pytest.approx(pressed.load, rel=1e-9)
    assert state.approach[0] == pytest.approx(pressed.approach[0], rel=1e-12)
    np.testing.assert_allclose(
        state.seat.force, pressed.seat.force, atol=1e-9 * pressed.seat.force.max()
    )


def test_wrong_interference_is_refused():
    for kind in ("hertz", "punch"):
        with pytest.raises(
            InputError, match=f"{kind}.interference = 1 um: it takes the place of study.loads"
        ):
            load_scene(f"scenes/{kind}.toml", [f"{kind}.interference=1 um"])
    thin = [
        "hertz.dimension=2",
        "mesh.contact_size=0.2 mm",
        "study.loads=auto",
        "hertz.interference=10 nm",
    ]
    with pytest.raises(
        InputError, match=r"hertz\.interference = 0\.01 um \(a load of .*\): the contact radius"
    ):
        solve_pair(load_scene("scenes/hertz.toml", thin))


@pytest.mark.parametrize(
    "command, scene, options",
    [
        (
            "run",
            "punch",
            ["punch.dimension=2", "study.loads=1 kN, 2 kN", "mesh.contact_size=0.4 mm"],
        ),
        ("contact", "hertz", ["hertz.dimension=2", "study.loads=1 MN"]),
    ],
)
def test_commands_leave_a_run_folder(command, scene, options, tmp_path, capsys):
    given = [part for option in options for part in ("--set", option)]
    assert main([command, f"scenes/{scene}.toml", "-o", str(tmp_path), *given]) == 0
    said = capsys.readouterr().out
    assert (
        "closed form [MPa]" in said
        and "of the closed form" in said
        and f"results: {tmp_path}" in said
    )
    points = pd.read_csv(tmp_path / "points.csv")
    assert {"pressure [Pa]", "pressure_exact [Pa]", "radius [m]"} <= set(points)
    pressed = np.isfinite(points["pressure_exact [Pa]"]) & (points["radius [m]"] < 6e-4)
    assert np.allclose(
        points["pressure [Pa]"][pressed], points["pressure_exact [Pa]"][pressed], rtol=0.05
    )
    face = read_results(tmp_path / "results.nc", "resultants").isel(seat=0)
    part = face["normal_force"].to_numpy()  # of the half in the plane
    np.testing.assert_allclose(part, face["load"] / 2, rtol=1e-9)
    for name in (
        "mesh.png",
        "pressure.png",
        "report.html",
        "report.md",
        "results.nc",
        "pressure.vtu",
        "scene.toml",
    ):
        assert (tmp_path / name).stat().st_size > 500, name


@pytest.mark.parametrize("command", ["modes", "response"])
def test_modes_and_responses_name_the_command_that_serves(command, tmp_path, capsys):
    assert (
        main([command, "scenes/punch.toml", "--set", "punch.dimension=2", "-o", str(tmp_path)]) == 2
    )
    assert "'bladefem run' computes its contact pressure" in capsys.readouterr().err
