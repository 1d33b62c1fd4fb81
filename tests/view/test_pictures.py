"""Pictures exist, are not blank, and show what they should; skins and VTU files against known
geometry.
"""

import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import synthetic
from matplotlib.image import imread

from bladefem.contact.resultants import resultant
from bladefem.view import modes as modes_view
from bladefem.view.accuracy import draw_accuracy, pareto_front
from bladefem.view.contact import (
    draw_pressure,
    pressure_points,
    pressure_summary,
    save_pressure_vtu,
    unfold,
)
from bladefem.view.hysteresis import _columns_of, draw_loops, draw_seat_loops, loop_energy
from bladefem.view.live_curves import live_optimum, live_responses
from bladefem.view.live_shapes import live_motion
from bladefem.view.mesh import (
    carry_round,
    draw_legend,
    draw_mesh,
    label_colours,
    pyvista_grid,
    save_vtu,
)
from bladefem.view.modes import (
    animate_wave,
    best_phase,
    draw_mode,
    draw_mode_sheet,
    draw_wheel_mode,
    moving_bodies,
    save_modes_vtu,
)
from bladefem.view.motion import (
    PHASES_PER_PERIOD,
    amplitude_of,
    displaced,
    draw_motion,
    extreme_phase,
)
from bladefem.view.optimum import draw_optimum
from bladefem.view.response import FOLLOWED, MARCHED, draw_responses, resonance_of, smooth_curve
from bladefem.view.skin import row_keys, skin, wheel_skin
from bladefem.view.style import SUPERSAMPLING, canvas, enlarged_lines, show_photograph
from geometry.mesh import Mesh, Sector


def ink(file):
    """Share of pixels that are not white."""
    return np.mean(np.any(imread(file)[..., :3] < 0.98, axis=2))


def area(surface):
    a, b, c = (surface.points[surface.triangles[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def test_grid_volume_is_the_sectors_volume(sector):
    """VTK integrates the straight-sided cells: chords of the polar grid, exact formula for each
    prism ring.
    """
    cells = pyvista_grid(sector).compute_cell_sizes(length=False, area=False)
    disc = 0.04 * 8 * 0.5 * np.sin(2 * np.pi / 12 / 8) * (0.16**2 - 0.1**2)
    blade = 0.04 * 2 * 0.5 * np.sin(2 * np.pi / 12 / 8) * (0.28**2 - 0.16**2)
    body = np.asarray(cells["body"]) == 0
    assert np.isclose(np.sum(cells["Volume"][body]), disc + blade, rtol=1e-9)
    assert np.all(cells["Volume"] > 0)


def test_skin_labels_every_named_face(sector):
    surface = skin(sector)
    for name, face in sector.faces.items():
        assert np.sum(surface.labels == surface.names.index(name)) == 4 * len(face)
    low = surface.labels == surface.names.index("cyclic_low")
    assert np.isclose(area(surface)[low].sum(), 0.06 * 0.04)


def test_coarse_skin_has_the_same_flat_area(sector):
    fine, coarse = skin(sector), skin(sector, coarse=True)
    assert len(fine.triangles) == 4 * len(coarse.triangles)
    assert np.isclose(area(fine).sum(), area(coarse).sum())


@pytest.mark.parametrize("count", [8, 20, 27])
def test_hexahedra_and_vtk_order(count):
    """A cube of one cell: the volume that VTK integrates is 1, misplaced nodes would fold it; the
    skin's area is 6.
    """
    from bladefem.view.skin import EDGES
    from geometry.mesh import Mesh

    corners = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]]
    )
    middle = np.array([corners[list(edge)].mean(axis=0) for edge in EDGES["hexahedron"]])
    faces = np.array(
        [[0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5], [1, 0.5, 0.5], [0.5, 1, 0.5], [0.5, 0.5, 1]]
    )
    points = np.concatenate([corners, middle, faces, [[0.5, 0.5, 0.5]]])[:count]
    cube = Mesh(
        points, "hexahedron" + (str(count) if count > 8 else ""), {"blade": np.arange(count)[None]}
    )
    assert np.isclose(area(skin(cube)).sum(), 6.0)
    assert np.isclose(pyvista_grid(cube).compute_cell_sizes()["Volume"][0], 1.0)


def test_unknown_cells_are_refused():
    from bladefem.errors import InputError

    with pytest.raises(InputError, match="wedge"):
        draw_mesh(Mesh(np.zeros((6, 3)), "wedge", {"blade": np.arange(6)[None]}))


def test_numbers_of_a_drawing_are_no_names():
    """The face that a name was given to is told apart by its colour."""
    faces = {name: np.array([[0, 1, 2]]) for name in ("face_1", "tip", "face_12", "seat_left")}
    mesh = Mesh(np.zeros((4, 3)), "tetra", {"blade": np.arange(4)[None]}, faces=faces)
    body, first, tip, second, seat = label_colours(mesh)
    assert body == first == second
    assert len({body, tip, seat}) == 3
    with canvas() as ax:
        draw_legend(ax, mesh)
        named = [text.get_text() for text in ax.get_legend().get_texts()]
    assert named == ["blade (1)", "tip (1)", "seat_left (1)"]


@pytest.mark.parametrize("step", [1, 10**12])
def test_rows_of_the_same_nodes_have_one_key(step):
    """Also where a product of the node numbers would not fit into 64 bits."""
    rows = step * np.array([[1, 2, 3], [3, 1, 2], [1, 2, 4], [2, 3, 3], [3, 2, 3]])
    keys = row_keys(rows)
    assert keys[0] == keys[1] and keys[3] == keys[4] and len(set(keys.tolist())) == 3


def test_a_figure_is_drawn_once_to_be_saved(tmp_path, monkeypatch):
    """Pictures in it would be made smaller twice, once only to find out where they go."""
    from matplotlib import image

    drawn = []
    plain = image.AxesImage.make_image
    monkeypatch.setattr(
        image.AxesImage, "make_image", lambda *args, **_: drawn.append(1) or plain(*args, **_)
    )
    with canvas(tmp_path / "a.png") as ax:
        ax.imshow(np.zeros((50, 50, 3), np.uint8))
    assert drawn == [1] and (tmp_path / "a.png").exists()


def test_a_dollar_sign_is_no_formula_on_axes_that_are_off(tmp_path):
    with canvas(tmp_path / "a.png") as ax:
        ax.set_axis_off()
        ax.set_title("$mode$", loc="center")
        ax.text(0.5, 0.5, "a $ b $ c")
    assert not ax.title.get_parse_math() and not ax.texts[0].get_parse_math()


def test_wheel_has_no_cut_faces_and_closes(sector):
    """The wheel's triangles enclose the disc and blades: Gauss' theorem gives N times the sector's
    volume.
    """
    wheel = wheel_skin(sector)
    a, b, c = (wheel.points[wheel.triangles[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    cells = pyvista_grid(sector).compute_cell_sizes(length=False, area=False)
    assert np.isclose(volume, 12 * np.sum(cells["Volume"]), rtol=1e-9)


def test_carrying_round_repeats_the_wave(sector, wave):
    """u = (r - r0)^2 e^{3 j angle} e_z on the whole wheel is what the sector's field becomes."""
    around = carry_round(sector, wave.shapes[0], 3)
    points = np.concatenate(
        [sector.points @ np.linalg.matrix_power(sector.sector.rotation, k).T for k in range(12)]
    )
    r, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    # arctan2 jumps at pi, where e^{3 j angle} does not.
    assert np.allclose(around[:, 2], (r - 0.1) ** 2 * np.exp(3j * angle), atol=1e-12)


def test_best_phase_makes_the_real_part_largest():
    shape = np.exp(0.7j) * np.array([[1.0, 0.2, 0], [0.3j, 0, 1]])
    best = np.sum(np.real(shape * best_phase(shape)) ** 2)
    others = [np.sum(np.real(shape * np.exp(1j * t)) ** 2) for t in np.linspace(0, np.pi, 200)]
    assert best >= max(others) - 1e-12


def test_mesh_pictures(sector, plane_row, folder):
    for name, mesh in {"sector": sector, "row": plane_row}.items():
        draw_mesh(mesh, folder / f"mesh-{name}.png")
        assert ink(folder / f"mesh-{name}.png") > 0.05


def test_mode_pictures(sector, wave, folder):
    draw_mode(sector, wave, 0, folder / "mode.png", family="first flap")
    draw_wheel_mode(sector, wave, 1, folder / "wheel.png")
    draw_mode_sheet(sector, wave, folder / "sheet.png")
    assert min(ink(folder / name) for name in ("mode.png", "wheel.png", "sheet.png")) > 0.1


def test_faces_that_look_away_are_left_out_of_wheels_alone(sector, plane_row):
    assert modes_view.hidden_faces(sector) == {"culling": "back"}
    assert modes_view.hidden_faces(plane_row) == {}
    # a row of solids is open at its ends
    row = replace(sector, sector=Sector(0, np.eye(3), np.array([0.0, 0.1, 0.0])))
    assert modes_view.hidden_faces(row) == {}


def test_faces_that_look_away_change_no_picture(sector, wave, monkeypatch):
    """But for single pixels on edges."""
    (with_them, without) = [], []
    for frames, options in ((without, {"culling": "back"}), (with_them, {})):
        monkeypatch.setattr(modes_view, "hidden_faces", lambda _, options=options: options)
        frames += [np.array(f, int) for f in modes_view.wave_frames(sector, wave, 0, 4, 160)]
    for one, other in zip(with_them, without, strict=True):
        assert np.mean(abs(one - other).max(axis=2) > 8) < 2e-3


def test_a_forward_wave_is_the_backward_one_played_the_other_way(sector, wave):
    backward, forward = (
        [np.array(f, int) for f in modes_view.wave_frames(sector, wave, 0, 4, 160, way)]
        for way in (False, True)
    )
    for k, frame in enumerate(forward):
        np.testing.assert_array_equal(frame, backward[-k % 4])
    assert np.any(backward[1] != backward[3])


def test_renderings_are_saved_with_their_own_pixels(folder):
    """A chequered picture stays one: each pixel of the file is one of the picture, scaled once."""
    picture = np.indices((160, 160)).sum(axis=0)[..., None] % 2 * np.full(3, 255, np.uint8)
    with canvas(folder / "own.png", size=(2.0, 2.0)) as ax:
        ax.figure.set_layout_engine(None)
        # 160 pixels an inch
        ax.set_position([0.25, 0.25, 0.5, 0.5])
        show_photograph(ax, picture.astype(np.uint8))
    saved = imread(folder / "own.png")[80:240, 80:240, 0]
    np.testing.assert_array_equal(saved, picture[..., 0] / 255)


def test_wheel_picture_shows_six_nodal_radii(sector, wave, folder):
    """The signed colour changes sign 2 n times round the rim; the picture's titled component is the
    axial one.
    """
    figure = draw_wheel_mode(sector, wave, 0)
    assert any("axial" in ax.get_ylabel() for ax in figure.axes)
    assert "nodal diameter 3" in figure.get_suptitle()


def test_a_sheet_is_drawn_in_one_window(sector, wave, folder, monkeypatch):
    """Each shape as it is drawn alone, whatever was drawn before it."""
    opened = []
    plain = modes_view.open_plotter
    monkeypatch.setattr(
        modes_view, "open_plotter", lambda *a, **k: opened.append(a) or plain(*a, **k)
    )
    shape = np.real(wave.shapes[0] * best_phase(wave.shapes[0]))
    values = np.linalg.norm(shape, axis=1)
    factor = modes_view.scale_of(sector, shape)
    drawn = [(shape, sign * factor, values) for sign in (1, -1, 1)]
    images = list(modes_view.photograph_shapes(sector, drawn, (1.0, 0.5, 0.3), (200, 240)))
    assert len(opened) == 1
    alone = [
        next(modes_view.photograph_shapes(sector, [one], (1.0, 0.5, 0.3), (200, 240)))
        for one in drawn
    ]
    for image, other in zip(images, alone, strict=True):
        assert image.shape == other.shape
        assert abs(image.astype(int) - other).mean() < 0.5
    assert images[0].shape != images[1].shape or abs(images[0].astype(int) - images[1]).mean() > 0.5


def test_lines_are_as_wide_in_a_window_that_is_enlarged():
    assert enlarged_lines({"line_width": 2.0})["line_width"] == 2.0 * SUPERSAMPLING
    assert enlarged_lines({"color": "black"}) == {"color": "black"}


def test_travelling_wave_turns(sector, wave, folder):
    from PIL import Image

    animate_wave(sector, wave, 0, folder / "wave.gif", frames=4, pixels=160)
    picture = Image.open(folder / "wave.gif")
    frames = []
    for k in range(picture.n_frames):
        picture.seek(k)
        frames.append(np.asarray(picture.convert("RGB"), float))
    assert len(frames) == 4
    assert np.abs(frames[0] - frames[2]).max() > 50


def test_vtu_holds_the_fields(sector, wave, folder):
    import meshio
    import pyvista

    one = pyvista.read(save_vtu(sector, folder / "one.vtu", {"u [m]": wave.shapes[0]}))
    assert np.allclose(one["u, imaginary [m]"], wave.shapes[0].imag)
    full = pyvista.read(save_modes_vtu(sector, wave, folder / "full.vtu"))
    by_meshio = meshio.read(folder / "full.vtu").point_data
    assert by_meshio.keys() == set(full.point_data.keys())
    assert f"mode 1, {wave.frequencies[0]:.6g} Hz, real [kg^-1/2]" in by_meshio
    assert full.n_points == len(wheel_skin(sector).points)
    volume = pyvista.read(save_modes_vtu(sector, wave, folder / "volume.vtu", volume=True))
    assert volume.n_cells == 12 * sum(len(c) for c in sector.bodies.values())


def test_pressure_numbers_and_picture(folder):
    seats = synthetic.seats()
    table = pressure_summary(seats)
    assert np.allclose(table["force"], 120.0)
    assert np.allclose(table["area"], 0.04 * 0.006)
    # Centre of the parabola 1 - ((z - 4) / 20)^2 on -16..20 mm is 2.98 mm; sampled at 11 points
    # 3.55.
    assert np.allclose(resultant(seats[0]).centre[2], 3.5509e-3, atol=1e-6)
    assert len(pressure_points(seats)) == 2 * 77
    draw_pressure(seats, folder / "pressure.png")
    draw_pressure(synthetic.line_seats(), folder / "line.png")
    assert min(ink(folder / name) for name in ("pressure.png", "line.png")) > 0.05


@pytest.mark.parametrize("some_open", [False, True])
def test_open_nodes_are_in_the_legend_where_there_are_some(some_open):
    """On whichever of the faces they are."""
    pressed, other = (replace(one, force=np.ones(len(one.force))) for one in synthetic.seats())
    if some_open:
        other = replace(other, force=np.arange(len(other.force)) - 3.0)
    texts = draw_pressure([pressed, other]).legends[0].get_texts()
    assert ("open node" in [text.get_text() for text in texts]) == some_open


def test_an_even_pressure_is_no_black_page():
    """The largest pressure of a seat is everywhere where it is pressed evenly. Luminance of WCAG
    2.1: black on 0.04 has a contrast of 1.8; it was 0.
    """
    even = [replace(one, force=4e6 * one.patch.area) for one in synthetic.seats()]
    figure = draw_pressure(even)
    figure.canvas.draw()
    *_, mesh = (c for c in figure.axes[0].collections if c.get_array() is not None)
    shades = np.array(mesh.to_rgba(4.0)[:3])
    linear = np.where(shades <= 0.04045, shades / 12.92, ((shades + 0.055) / 1.055) ** 2.4)
    assert np.dot([0.2126, 0.7152, 0.0722], linear) > 0.04


def test_pressure_for_paraview(folder):
    import pyvista

    for name, seats in (("faces", synthetic.seats()), ("lines", synthetic.line_seats())):
        grid = pyvista.read(save_pressure_vtu({40.0: seats, 80.0: seats}, folder / f"{name}.vtu"))
        assert grid.n_cells == sum(len(s.patch.faces) for s in seats)
        pressure = np.concatenate([s.pressure for s in seats])
        np.testing.assert_allclose(grid["pressure [Pa] at 80 N"], pressure)
        np.testing.assert_allclose(
            grid["area [m^2]"] @ grid["pressure [Pa] at 40 N"], sum(s.force.sum() for s in seats)
        )


def test_pressure_in_a_folder_whose_name_the_locale_lacks(tmp_path):
    """As umlauts in a locale of ASCII; here a letter of Latin 1 in one of UTF-8."""
    file = tmp_path / os.fsdecode(b"\xfc") / "pressure.vtu"
    assert save_pressure_vtu({40.0: synthetic.seats()}, file).stat().st_size > 0


def test_unfolding_keeps_lengths():
    patch = synthetic.seats()[1].patch
    flat = unfold(patch)
    for i, j in ((0, 76), (3, 40), (10, 11)):
        assert np.isclose(
            np.linalg.norm(flat[i] - flat[j]), np.linalg.norm(patch.points[i] - patch.points[j])
        )


def test_response_charts(folder):
    figure = draw_responses(synthetic.points(), folder / "response.png")
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert "not converged (3)" in labels and "200 N" in labels
    # each curve has its load beside its highest point, none on another
    names = figure.axes[0].texts
    assert {"200 N", "800 N"} <= {name.get_text() for name in names}
    boxes = [name.get_window_extent() for name in names]
    assert not any(box.count_overlaps(boxes[:i]) for i, box in enumerate(boxes))
    figure = draw_optimum(synthetic.summary(), folder / "optimum.png")
    text = " ".join(t.get_text() for t in figure.axes[0].get_legend().get_texts())
    assert "optimum 200 N" in text and "92.6 % below" in text
    # no line of a load strikes the frequency through
    assert figure.axes[1].texts[0].get_bbox_patch().get_facecolor()[:3] == (1.0, 1.0, 1.0)
    searched = pd.DataFrame(
        {
            "load": [170.0],
            "frequency": [842.0],
            "amplitude": [40e-6],
            "tolerated_from": [140.0],
            "tolerated_to": [210.0],
        }
    )
    figure = draw_optimum(synthetic.summary(), folder / "exact.png", searched=searched)
    text = " ".join(t.get_text() for t in figure.axes[0].get_legend().get_texts())
    assert "optimum 170 N: 40 µm" in text and "140 to 210 N: within accuracy of the optimum" in text
    figure = draw_optimum(synthetic.summary(), searched=searched, named=False)
    text = " ".join(t.get_text() for t in figure.axes[0].get_legend().get_texts())
    assert "no optimum is named" in text and "µm" not in text and "within accuracy" not in text
    assert not any(line.get_marker() == "*" for line in figure.axes[0].lines)
    draw_accuracy(synthetic.accuracy(), folder / "accuracy.png", tolerance=0.02)
    draw_loops(synthetic.loops(), folder / "loops.png")
    draw_seat_loops({f"{n} N": synthetic.loops() for n in range(5)}, folder / "seats.png")
    assert (
        min(ink(folder / f"{n}.png") for n in ("response", "optimum", "accuracy", "loops", "seats"))
        > 0.02
    )


def test_panels_of_loads_leave_few_places_empty():
    found = {n: _columns_of(n) for n in (1, 4, 5, 7, 9, 12, 13)}
    assert found == {1: 1, 4: 4, 5: 5, 7: 4, 9: 3, 12: 4, 13: 5}


@pytest.mark.parametrize(
    ("heights", "verdicts", "methods", "row", "apart"),
    [
        ([1.0, 3.0, 2.0], None, ["newton"] * 3, 1, False),
        ([1.0, 3.0, 2.0], ["", "unstable", ""], ["newton"] * 3, 2, False),
        ([1.0, 3.0, 2.0], ["unstable"] * 3, ["newton"] * 3, 1, False),
        ([1.0, 3.0, 2.0], ["", "", "stable"], ["newton", "newton", MARCHED], 2, True),
        ([1.0, 3.0, 2.0], None, [FOLLOWED, "newton", "newton"], 0, True),
    ],
)
def test_the_resonance_that_is_given_is_the_one_marked(heights, verdicts, methods, row, apart):
    """Under 40 N the mistuned scene keeps 495 um of its 637 um balance."""
    curve = pd.DataFrame(
        {
            "load": 40.0,
            "frequency": [1.0, 2.0, 3.0],
            "amplitude": 1e-6 * np.array(heights),
            "converged": True,
            "method": methods,
            **({} if verdicts is None else {"stability": verdicts}),
        }
    )
    assert resonance_of(curve) == (row, apart)
    axes = draw_responses(curve).axes[0]
    marks = [line for line in axes.lines if len(line.get_xdata()) == 1]
    assert [line.get_marker() for line in marks if line.get_xdata()[0] == row + 1][-1] == (
        "D" if apart else "o"
    )
    explained = [text.get_text() for text in axes.get_legend().get_texts()]
    assert ("resonance marched in time" in explained) == (MARCHED in methods)
    assert ("resonance of the stiff layer" in explained) == (FOLLOWED in methods)


def test_lower_motions_are_open_marks_below_their_resonances():
    """Of all curves of a picture one line of the legend."""
    points, summary = synthetic.points(), synthetic.summary()
    shown = [(200.0, 1e-6), (400.0, 2e-6)]
    for load, low in shown:
        top = points.loc[points["load"] == load, "amplitude"].idxmax()
        points.loc[top, "lower_amplitude"] = low
        summary.loc[summary["load"] == load, "lower_amplitude"] = low
    response, optimum = draw_responses(points).axes[0], draw_optimum(summary).axes[0]
    frequency = points[points["lower_amplitude"].notna()]["frequency"]
    for axes, at in ((response, frequency), (optimum, [load for load, _ in shown])):
        marks = [x for x in axes.lines if x.get_marker() == "v" and len(x.get_xdata())]
        xy = np.concatenate([line.get_xydata() for line in marks])
        np.testing.assert_allclose(xy, np.stack([at, [1.0, 2.0]], axis=1))
        assert {line.get_markerfacecolor() for line in marks} == {"white"}
        labels = [text.get_text() for text in axes.get_legend().get_texts()]
        assert labels.count("lower motion there, from rest") == 1
    for figure in (draw_responses(synthetic.points()), draw_optimum(synthetic.summary())):
        texts = figure.axes[0].get_legend().get_texts()
        assert not any("lower motion" in text.get_text() for text in texts)


def test_lower_motions_are_open_marks_of_live_curves_too():
    points, summary = synthetic.points(), synthetic.summary()
    top = points.loc[points["load"] == 200, "amplitude"].idxmax()
    points.loc[top, "lower_amplitude"] = 1e-6
    summary.loc[summary["load"] == 200, "lower_amplitude"] = 1e-6
    frequency = float(points["frequency"][top])
    for spec, at in ((live_responses(points), frequency), (live_optimum(summary), 200.0)):
        marks = [t for t in spec["data"] if t["name"] == "lower motion there, from rest"]
        assert [(t["x"], t["y"]) for t in marks] == [([pytest.approx(at)], [1.0])]
        assert marks[0]["marker"]["symbol"] == "triangle-down-open"
        assert marks[0]["text"] == ["200 N"]
    for spec in (live_responses(synthetic.points()), live_optimum(synthetic.summary())):
        assert not any("lower" in t["name"] for t in spec["data"])


def test_an_optimum_chart_shows_the_estimated_errors():
    summary = synthetic.summary().assign(error=0.02)
    summary.loc[summary["load"] == 200, "error"] = 3.0
    summary.loc[summary["load"] == 400, "error"] = np.inf
    bars = draw_optimum(summary).axes[0].containers[0].lines[2][0].get_segments()
    for (load, low), (_, high) in bars:
        amplitude = 1e6 * summary.set_index("load")["peak_amplitude"][load]
        below, above = {200: (0.9, 3.0), 400: (0.0, 0.0)}.get(load, (0.02, 0.02))
        assert (low, high) == pytest.approx((amplitude * (1 - below), amplitude * (1 + above)))
    assert len(bars) == (np.isfinite(summary["load"]) & (summary["load"] > 0)).sum()


def test_a_curve_between_its_points_stays_between_them():
    """No overshoot at a sharp peak, a gap where a point is missing, and the points themselves."""
    x, y = np.arange(7.0), np.array([1.0, 2.0, 50.0, 3.0, np.nan, 4.0, 5.0])
    fine, drawn = smooth_curve(x, y)
    assert np.nanmax(drawn) == pytest.approx(50.0) and np.nanmin(drawn) == pytest.approx(1.0)
    assert not ((fine > 3) & (fine < 5)).any() and np.isnan(drawn).sum() == 3
    assert set(x[np.isfinite(y)]) <= set(fine)


def test_peaks_at_the_end_of_the_band_are_hollow():
    points = synthetic.points().query("frequency <= 900")
    summary = points.loc[points.dropna().groupby("load")["amplitude"].idxmax()].rename(
        columns={"frequency": "peak_frequency", "amplitude": "peak_amplitude"}
    )
    figure = draw_optimum(summary, points=points)
    hollow = next(line for line in figure.axes[0].lines if "no peak" in str(line.get_label()))
    assert hollow.get_xdata().tolist() == [400.0, 800.0, 1600.0, np.inf]


def test_bodies_at_rest_are_not_drawn(sector, wave):
    still = wave.shapes[0].copy()
    still[np.unique(sector.bodies["damper"])] = 0
    assert list(moving_bodies(sector, still).bodies) == ["blade"]
    assert list(moving_bodies(sector, wave.shapes[0]).bodies) == ["blade", "damper"]


def test_a_motion_is_drawn_where_it_is_largest(sector, plane_row, folder):
    """cos t + cos(3 t) / 3 is largest at the start, sin t at a quarter of the period."""
    for mesh in (sector, plane_row):
        motion = np.zeros((3, len(mesh.points), mesh.dimension), complex)
        motion[0, :, 1] = -1j * mesh.points[:, 0]
        assert extreme_phase(motion) % np.pi == pytest.approx(np.pi / 2)
        motion[0], motion[2] = 1j * motion[0], 1j * motion[0] / 3
        assert extreme_phase(motion) == 0.0
        largest = np.hypot(1, 1 / 3) * abs(mesh.points[:, 0]).max()
        assert amplitude_of(motion).max() == pytest.approx(largest)
        draw_motion(mesh, 1e-4 * motion, folder / "motion.png", title="80 N per seat")
        assert ink(folder / "motion.png") > 0.02


@pytest.mark.parametrize("seed", range(5))
def test_the_phase_of_the_largest_displacement_is_that_of_all_nodes(seed):
    """Nodes that cannot have it are left out."""
    draw = np.random.default_rng(seed).standard_normal
    size = np.exp(2 * draw((1, 400, 1)))
    motion = size * (draw((4, 400, 3)) + 1j * draw((4, 400, 3)))
    phases = 2 * np.pi * np.arange(PHASES_PER_PERIOD) / PHASES_PER_PERIOD
    largest = [np.linalg.norm(displaced(motion, phase), axis=1).max() for phase in phases]
    assert extreme_phase(motion) == pytest.approx(phases[int(np.argmax(largest))], abs=1e-12)


def test_a_motion_on_a_page_keeps_the_harmonics_that_are_seen(sector):
    motion = np.zeros((3, len(sector.points), 3), complex)
    motion[0, :, 1], motion[1, :, 1], motion[2, :, 2] = 1e-4, 1e-7, 1e-5j
    spec = live_motion(sector, {"80 N": motion})
    (mode,) = spec["modes"]
    assert [part["order"] for part in mode["harmonics"]] == [1, 3]
    assert mode["amplitude"] == pytest.approx(1e2 * np.hypot(1, 0.1), rel=1e-4)
    assert live_motion(sector, {}) is None


def test_loop_energy_is_jenkins():
    """4 F (A - F / k) for macro-slip, 0 in stick; 400 samples cut the corners by less than 1 %."""
    energies = [loop_energy(*loop) for loop in synthetic.loops().values()]
    assert np.allclose(energies, [0.0, 4 * 3 * 2e-6, 4 * 3 * 7e-6], rtol=1e-2, atol=1e-15)


def test_pareto_front():
    assert pareto_front(np.array([1.0, 2, 3, 4]), np.array([4.0, 5, 2, 3])).tolist() == [0, 2]
