"""Errors of frequencies by meshes, on made-up and real sequences; effective masses that add up to the wheel's
mass.
"""

import json
from dataclasses import replace
from pathlib import Path

import decks
import numpy as np
import pandas as pd
import pytest
from structured import box, sector
from wheels import bodies

from bladefem.errors import InputError
from bladefem.fem import all_diameters
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.loads import body_mass
from bladefem.fem.modes import modes
from bladefem.fem.stiffness_error import frequency_errors
from bladefem.report.modes import _numbers
from bladefem.scene.tables import Material
from bladefem.scene.toml import load_scene, scene_of
from bladefem.study.modes import survey as survey_module
from bladefem.study.modes.effective_mass import effective_masses
from bladefem.study.modes.frequency_error import (
    PLAUSIBLE_ORDERS,
    convergence_summary,
    fitted_order,
    richardson,
    scaled_error,
)
from bladefem.study.modes.mesh_convergence import (
    MODES_STUDIED,
    SIZE_RATIOS,
    SolvedMesh,
    default_sizes,
    mesh_convergence,
    of_meshes,
    paired_modes,
)
from bladefem.study.modes.survey import Wanted, survey_modes
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import find_modes
from bladefem.study.pipeline.scene_mesh import build_mesh
from geometry.export import write_msh


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0, 5.7])
@pytest.mark.parametrize("sizes", [(4, 2, 1), (1.7, 1.31, 1.0)])
def test_a_power_law_is_found(order, sizes):
    h = np.array(sizes)
    limit, found = richardson(h, 100 + 3 * h**order)
    assert limit == pytest.approx(100, rel=1e-9) and found == pytest.approx(order, rel=1e-6)


@pytest.mark.parametrize("f", [(3, 1, 2), (1, 1, 1), (3, 2.9, 1)])
def test_values_out_of_line_have_no_order(f):
    limit, order = richardson(np.array([2, 1.4, 1]), np.array(f, float))
    assert limit == f[2] and np.isnan(order)


def test_more_meshes_are_fitted_and_their_scatter_told():
    h = np.array([2.0, 1.7, 1.4, 1.2, 1.0])
    exact = 100 + 3 * h**3
    assert fitted_order(h, exact) == pytest.approx((100, 3, 0), abs=1e-4)
    noise = 0.3 * np.array([1, -1, 1, -1, 1])
    limit, order, scatter = fitted_order(h, exact + noise)
    assert limit == pytest.approx(100, abs=1.5) and 2 < order < 4 and 0.2 < scatter < 0.6
    assert np.isnan(fitted_order(h, 100 + noise)[1])


@pytest.mark.parametrize(
    "cell_type, order", [("triangle", 2), ("quad", 2), ("triangle6", 4), ("quad9", 4)]
)
@pytest.mark.parametrize("divisions", [(6, 9, 12), (6, 7, 8, 10, 12)])
def test_cantilever_has_the_order_of_its_elements(cell_type, order, divisions):
    """Extension of a clamped bar at nu = 0 is f = (2k - 1) c / 4L: order 2 and 4, and a limit far
    nearer to it. The error is never reported below half, whatever the order.
    """
    material = Material(nu=0.0)
    exact = np.sqrt(material.E / material.rho) / 4
    runs = []
    for n in divisions:
        mesh = box((n, n), (1.0, 1.0), cell_type)
        body = assemble(mesh, "blade", material)
        found = modes(constrain(body), 6)
        runs.append(SolvedMesh(mesh, [found], [frequency_errors(body, found)]))
    found = of_meshes(runs, 4).summary
    row = found.loc[(found["limit"] / exact - 1).abs().idxmin()]
    assert row["reason"] == "" and row["order"] == pytest.approx(order, abs=0.15)
    assert abs(row["limit"] / exact - 1) < 0.05 * abs(row["frequency"] / exact - 1)
    true = row["frequency"] / exact - 1
    assert 0.95 * true < row["error"] < 3 * true


def test_sizes_scale_the_whole_mesh():
    """Every size is scaled alike, also those that the scene does not name: cells grow with the
    square of the ratio.
    """
    scene = load_scene("scenes/plane.toml")
    meshes = [
        build_mesh(replace(scene, mesh=replace(scene.mesh, scale=s))) for s in (1.0, 0.5, 0.25)
    ]
    cells = [len(mesh.bodies["blade"]) for mesh in meshes]
    assert np.log2(cells[1] / cells[0]) == pytest.approx(2, abs=0.35)
    assert np.log2(cells[2] / cells[1]) == pytest.approx(2, abs=0.35)


def test_plane_blade_converges():
    """Frequencies fall as the mesh is refined, and the estimate lies below the finest by about what
    it says.
    """
    scene = load_scene("scenes/plane.toml")
    found = mesh_convergence(scene, [6e-3, 4e-3, 2.8e-3], count=3)
    assert len(found.points) == 9 and len(found.summary) == 3
    finer = (
        mesh_convergence(scene, [2.8e-3, 2e-3, 1.4e-3], count=3)
        .points.query("dofs == dofs.max()")["frequency"]
        .to_numpy()
    )
    assert (finer < found.summary["frequency"].to_numpy()).all()
    left = found.summary["frequency"].to_numpy() / finer - 1
    assert (left < 2 * found.summary["error"]).all()
    assert (found.points["mac"] > 0.99).all()
    believed = found.summary[found.summary["reason"] == ""]
    assert believed["order"].between(*PLAUSIBLE_ORDERS).all()
    # the finest frequency is no limit
    assert ((found.summary["reason"] == "") == found.summary["limit"].notna()).all()


# [Hz] limits of plane.toml, from meshes of scale 1 to 0.1 (order 1.03 to 1.2, as its corners have)
PLANE_LIMITS = np.array([220.168, 1120.95, 3047.06, 4605.68, 7494.54])
# [Hz] from above, of wedge.toml in nodal diameter 9: mesh.size 9 mm with mesh.scale 0.3, 167 085
# degrees of freedom
WEDGE_BOUNDS = np.array([369.223, 860.987, 1879.782, 1906.286, 2496.348])


@pytest.mark.parametrize("scale", [1, 2, 3, 6])
def test_error_by_corners_is_not_below_half_of_the_true_one(scale):
    """Sizes a factor of two apart show orders of up to 12, or no order, where corners allow 1.1."""
    scene = load_scene("scenes/plane.toml", [f"mesh.scale={scale}"])
    found = mesh_convergence(scene, default_sizes(scene)).summary
    true = found["frequency"].to_numpy() / PLANE_LIMITS - 1
    error = found["error"].to_numpy()
    assert (error > 0.5 * true).all() and (error < 3 * true).all()


def test_sizes_that_hardly_differ():
    """Frequencies that scatter, and estimated errors too: those of the last mesh, times 1.25."""
    scene = load_scene("scenes/plane.toml")
    found = mesh_convergence(scene, [3e-3, 2.9e-3, 2.8e-3]).summary
    true = found["frequency"].to_numpy() / PLANE_LIMITS - 1
    assert (found["error"] > 0.5 * true).all() and (found["error"] < 3 * true).all()


def test_meshes_that_are_not_finer_where_their_sizes_are():
    """Of 14, 11 and 9 mm the second has lower frequencies than the third: the last change is
    noise. With cells by HXT; with those by Delaunay not all modes are out of line.
    """
    overrides = ["mesh.size=9 mm", "mesh.algorithm=hxt", "model.nodal_diameters=9"]
    scene = load_scene("scenes/wedge.toml", overrides)
    found = mesh_convergence(scene, [14e-3, 11e-3, 9e-3], [9]).summary
    assert (found["reason"] != "").all()
    bound = found["frequency"].to_numpy() / WEDGE_BOUNDS - 1
    # what the meshes of the bounds lack themselves: 0.3 to 0.9 %
    assert (found["error"] > 0.8 * bound).all() and (found["error"] < 3 * bound).all()


def test_estimated_errors_are_scaled_by_what_the_meshes_changed():
    x = np.array([0.04, 0.02, 0.01])
    for scale, reported in ((2.0, 2.0), (0.5, 1.0), (5.0, 3.0)):
        f = 100 / (1 - scale * x)
        assert scaled_error(f, x) == pytest.approx(reported * 0.01, rel=0.15)
    # no line
    assert scaled_error(np.array([101.0, 100.0]), np.array([0.011, 0.01])) == 0.0125


def test_modes_that_cross_keep_their_names():
    """The first two modes of the coarser mesh change places: their shapes tell which is which."""
    scene = load_scene("scenes/plane.toml")
    meshes = [
        build_mesh(replace(scene, mesh=replace(scene.mesh, size=size))) for size in (6e-3, 4e-3)
    ]
    coarse, fine = (find_modes(Bodies(scene, mesh), None, 4)[0] for mesh in meshes)
    turned = replace(
        coarse, frequencies=coarse.frequencies[[1, 0, 2, 3]], shapes=coarse.shapes[[1, 0, 2, 3]]
    )
    numbers, match = paired_modes(meshes[0], turned, meshes[1], fine, 3)
    assert list(numbers) == [1, 0, 2] and match.min() > 0.99


def test_an_order_that_no_element_has_is_not_believed():
    points = pd.DataFrame(
        {
            "size": [2.0, 1.4, 1.0],
            "mode": 1,
            "frequency": [130.0, 103.0, 100.0],
            "estimated": np.nan,
            "mac": 1.0,
        }
    )
    row = convergence_summary(points).iloc[0]
    assert (
        "order 6.1 is not plausible" in row["reason"]
        and np.isnan(row["limit"])
        and row["error"] == pytest.approx(0.09)
    )
    row = convergence_summary(points.assign(mac=0.5)).iloc[0]
    assert "MAC 0.50" in row["reason"] and row["error"] == pytest.approx(0.09)


def test_an_order_that_the_stress_contradicts_is_not_believed():
    """Order 4 leaves 0.2 %, the estimate is 2 %."""
    h = np.array([2.0, 1.4, 1.0])
    points = pd.DataFrame(
        {"size": h, "mode": 1, "frequency": 100 + 0.2 * h**4, "estimated": 0.02 * h, "mac": 1.0}
    )
    row = convergence_summary(points).iloc[0]
    assert row["order"] == pytest.approx(4) and "far less than the estimate" in row["reason"]
    assert np.isnan(row["limit"]) and row["error"] >= 0.02
    row = convergence_summary(points.assign(estimated=0.002 * h**4)).iloc[0]
    assert row["reason"] == "" and row["error"] == pytest.approx(0.002, rel=0.01)


def test_a_lower_frequency_of_another_mesh_is_a_bound():
    points = pd.DataFrame(
        {
            "size": [1.5, 1.2, 1.0],
            "mode": 1,
            "frequency": [103.0, 100.0, 102.0],
            "estimated": [0.004, 0.003, 0.002],
            "mac": 1.0,
        }
    )
    assert convergence_summary(points).iloc[0]["error"] >= 0.02


def test_a_rigid_mode_has_no_error():
    points = pd.DataFrame(
        {"size": [2.0, 1.4, 1.0], "mode": 1, "frequency": 0.0, "estimated": np.nan, "mac": 1.0}
    )
    row = convergence_summary(points).iloc[0]
    assert row["error"] == 0 and row["reason"].startswith("a rigid mode")


# [Hz] of `sector(9, (18, 12, 5))` of the default material, clamped, in nodal diameter 2: 15 s of CPU
FINER_RING = np.array([1167.10699252, 6440.94387528, 6541.04586956])


def test_a_mesh_of_a_file_is_halved(tmp_path):
    """The error that the given mesh is said to have holds the change to much finer ones."""
    write_msh(sector(9, (3, 2, 1), "tetra10"), tmp_path / "a.msh")
    tables = {
        "kind": "imported",
        "imported": {"file": str(tmp_path / "a.msh"), "sectors": 9},
        "operation": {"stiffening": False},
        "excitation": {"at": "x1"},
    }
    scene = scene_of(tables)
    assert default_sizes(scene) == []
    found = mesh_convergence(scene, [], [2], count=3)
    assert sorted(found.points["cells"].unique()) == [36, 288, 2304]
    row = found.summary
    true = abs(row["given"] / FINER_RING - 1)
    assert (true > 1e-3).all() and (true < 1.2 * row["given_error"]).all()
    assert (row["given_error"] < 4 * true).all()
    assert (row["error"] < row["given_error"]).all()


def test_the_elastic_modes_of_a_free_body_are_studied(tmp_path):
    """A file's bar that nothing holds: six rigid modes, exact on any mesh, before the five whose
    error is asked for; headlines begin with those.
    """
    write_msh(box((2, 1, 1), (0.1, 0.02, 0.03), "hexahedron27"), tmp_path / "a.msh")
    tables = {
        "kind": "imported",
        "imported": {"file": str(tmp_path / "a.msh")},
        "operation": {"speed": "0 rpm", "stiffening": False},
        "support": {"clamp": ""},
        "excitation": {"at": "x1"},
    }
    survey = survey_modes(scene_of(tables), tmp_path / "run", Wanted(sizes=()))
    found = survey.convergence.summary
    assert len(found) == 6 + MODES_STUDIED
    np.testing.assert_array_equal(found["given_error"][:6], 0)
    # halved twice: (1/4)^4 of the error is left
    true = found["given"][6:] / found["limit"][6:].fillna(found["frequency"]) - 1
    assert (true < 1.1 * found["given_error"][6:]).all() and (true[:2] > 1e-4).all()
    excited = survey.run.modes[0]
    first, *_ = _numbers(excited, [""] * len(excited.frequencies), survey, 0.0)
    assert first.what == "mode 7, " and "nan" not in first.uncertainty


def test_a_finished_folder_keeps_its_mesh_refinement(tmp_path, monkeypatch):
    """Of the same sizes; others are meshed and solved."""
    scene = load_scene("scenes/plane.toml", ["mesh.scale=2"])
    meshed = []

    def counted(scene, sizes, *others):
        meshed.append(list(sizes))
        return mesh_convergence(scene, sizes, *others)

    monkeypatch.setattr(survey_module, "mesh_convergence", counted)
    sizes = [0.02, 0.014, 0.01]
    made, found = (survey_modes(scene, tmp_path, Wanted(sizes=sizes)) for _ in range(2))
    assert meshed == [sizes]
    assert any(text.startswith("mesh refinement: found in") for text in found.run.messages)
    for name in ("points", "summary"):
        one, other = (getattr(survey.convergence, name) for survey in (made, found))
        pd.testing.assert_frame_equal(one, other)
    survey_modes(scene, tmp_path, Wanted(sizes=[0.02, 0.015, 0.01]))
    assert len(meshed) == 2


def test_cells_of_mixed_shapes_are_halved(tmp_path, monkeypatch):
    """As what they are: the finest mesh has CalculiX's frequencies on the same nodes (C3D15 and
    C3D20, ``python benchmarks/fem_decks.py``).
    """
    # those show that no mode is lost, as another factorisation of the finest mesh would
    monkeypatch.setattr(all_diameters, "lost_modes", lambda *_: {})
    model = decks.model("c3d15_c3d20", (4, 3, 2))
    tip = np.flatnonzero(np.hypot(*model.points[:, :2].T) > 0.2499)
    model.node_sets["tip"] = tip
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(model, {})))
    tables = {
        "kind": "imported",
        "imported": {"file": str(tmp_path / "a.inp"), "sectors": decks.SECTORS},
        "operation": {"stiffening": False},
        "excitation": {"at": "tip"},
    }
    found = mesh_convergence(scene_of(tables), [], [2], count=5)
    assert list(found.points["cells"].unique()) == [36, 288, 2304]
    assert found.points["size"].unique()[0] == pytest.approx(4 * found.points["size"].unique()[2])
    row = found.summary
    golden = json.loads((Path(decks.__file__).parent / "ccx_decks.json").read_text())["halved"]
    np.testing.assert_allclose(row["frequency"], golden[:5], rtol=2e-4)
    assert (row["reason"] == "").all() and row["order"].between(1.5, 4.5).all()
    # coarse elements are too stiff, and the finest ones by less
    assert (row["given_error"] > 5 * row["error"]).all()


def test_two_meshes_show_no_order():
    points = pd.DataFrame(
        {
            "size": [2.0, 1.0],
            "mode": 1,
            "frequency": [103.0, 100.0],
            "estimated": np.nan,
            "mac": 1.0,
        }
    )
    row = convergence_summary(points).iloc[0]
    assert row["reason"] == "two meshes show no order" and row["error"] == pytest.approx(0.09)


def test_wrong_sizes():
    scene = load_scene("scenes/plane.toml")
    for sizes in ([1e-3, 2e-3, 3e-3], [2e-3, 1e-3]):
        with pytest.raises(InputError, match="at least three element sizes, from coarse to fine"):
            mesh_convergence(scene, sizes)
    with pytest.raises(InputError, match="converge without sizes"):
        mesh_convergence(replace(scene, kind="imported"), [3, 2, 1])
    fine = replace(scene, mesh=replace(scene.mesh, size=1e-3))
    assert default_sizes(fine) == pytest.approx([1e-3 * r for r in SIZE_RATIOS])
    assert default_sizes(replace(scene, mesh=replace(scene.mesh, size=None))) == list(SIZE_RATIOS)


def test_effective_masses_add_up():
    """All modes of a nodal diameter together move the whole rigid wheel, but for what is held at
    the clamp.
    """
    one = bodies(count=5, divisions=(3, 1, 1))
    body = one.still_blade
    free = 3 * (len(np.unique(one.mesh.bodies["blade"])) - len(np.unique(one.mesh.faces["clamp"])))
    few = effective_masses([modes(constrain(body, "clamp", n), 40) for n in (0, 1, 2)], body)
    assert set(few["direction"]) == {"z", "rz", "x, y"} and set(few["nodal_diameter"]) == {0, 1}
    assert free > 40
    for _, rows in few.groupby("direction"):
        assert 0.75 < rows["sum"].iloc[-1] < 1.0
    lateral = few[few["direction"] == "x, y"].iloc[0]
    assert lateral["effective_mass"] / lateral["share"] == pytest.approx(
        5 * body_mass(body), rel=1e-6
    )
    assert few["factor"].to_numpy() ** 2 == pytest.approx(few["effective_mass"].to_numpy())
    single = effective_masses([modes(constrain(body, "clamp"), 5)], body)
    assert len(single) == 30 and "nodal_diameter" not in single


def test_first_bending_mode_carries_0_613_of_a_beams_mass():
    """Clamped-free beam: effective mass ratio of the first mode 0.6131 (Blevins)."""
    body = assemble(box((16, 1, 1), (1.0, 0.02, 0.015)), "blade", Material(nu=0.0))
    table = effective_masses([modes(constrain(body, "x0"), 2)], body)
    for number, direction in ((1, "z"), (2, "y")):
        row = table[(table["mode"] == number) & (table["direction"] == direction)].iloc[0]
        assert row["share"] == pytest.approx(0.6131, abs=1e-3)
