"""Crowned seats and eased edges: gaps by formula, Hertz' pressure on flat meshes, and a crowned
damper in its scene.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from blocks import clamped, compliances, facing_blocks, graded
from test_hertz import RADIUS, STEEL, A, modulus
from wedge import wedge_mesh

import bladefem
from bladefem.contact.complementarity import solve_lcp
from bladefem.contact.face_profile import seat_gap
from bladefem.contact.hertz import (
    MIN_ELEMENTS_PER_RADIUS,
    contact_modulus,
    line_width,
    point_radius,
)
from bladefem.contact.patch import make_patch, patch_means
from bladefem.contact.peak_pressure import narrow_sentence, peak_remarks
from bladefem.contact.seating import solve_seating
from bladefem.data import PressureMap
from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.flexibility import flexible
from bladefem.scene.tables import Contact, Material, Scene
from bladefem.study.pipeline.damper_contact import seat_damper
from bladefem.study.pipeline.validate_mesh import found_patches

ALPHA = np.radians(40)
# a layer so stiff that the shape of the faces decides where they press
STIFF = "contact.kn_area=1e6 N/mm^3"


def test_gaps_by_formula():
    """A patch of 20 by 12 mm: parabolas from its middle, and from the inner side of the eased
    strips.
    """
    mesh = facing_blocks(
        np.linspace(0, 0.012, 13), np.linspace(0, 0.01, 3), np.linspace(0, 0.02, 11)
    )
    patch = make_patch(mesh, "this")
    along, across = (mesh.points[:, :2] @ patch.frame[0, k, :2] for k in (2, 1))
    lengths = [np.ptp(v[patch.blade_nodes]) for v in (along, across)]
    s = [v - (v[patch.blade_nodes].min() + v[patch.blade_nodes].max()) / 2 for v in (along, across)]
    means = patch_means(patch, mesh).T
    crowned = seat_gap(patch, mesh, Contact(crown=5.0, crown_across=0.7))
    np.testing.assert_allclose(crowned, means @ (s[0] ** 2 / 10 + s[1] ** 2 / 1.4), atol=1e-18)
    eased = seat_gap(patch, mesh, Contact(edge_radius=0.1, edge_width=2e-3))
    strip = [
        np.clip(np.abs(v) - (length / 2 - 2e-3), 0, None) ** 2 / 0.2
        for v, length in zip(s, lengths, strict=True)
    ]
    np.testing.assert_allclose(eased, means @ sum(strip), atol=1e-18)
    assert not seat_gap(patch, mesh, Contact()).any()
    with pytest.raises(
        InputError, match=r"contact.edge_width = 500 um: narrower .* or a smaller mesh.contact_size"
    ):
        seat_gap(patch, mesh, Contact(edge_radius=0.1, edge_width=5e-4))


def test_a_crowned_flat_mesh_is_a_hertz_cylinder():
    """Two steel blocks, one with a crown of 50 mm, a/10: peak 1 %, half width by the second moment
    3 %.
    """
    half = graded(A / 10, 1.2 * A, 15 * A, 1.4)
    mesh = facing_blocks(np.r_[-half[:0:-1], half], graded(A / 10, 0.5 * A, 15 * A, 1.4))
    patch = make_patch(mesh, "this")
    C = sum(compliances(mesh, patch, *STEEL, clamped))
    gap, e = seat_gap(patch, mesh, Contact(crown_across=RADIUS)), modulus(*STEEL)
    load = np.pi * e * A**2 / (4 * RADIUS)
    s = solve_lcp(C, gap, -np.ones((len(C), 1)), [-load])
    p, x = s.force / patch.area, patch.points[:, 0]
    assert s.reason == ""
    assert p.max() == pytest.approx(e * A / (2 * RADIUS), rel=0.01)
    assert 2 * np.sqrt(s.force @ x**2 / load) == pytest.approx(A, rel=0.03)


@pytest.fixture(scope="module")
def bodies():
    """A small wedge between two stubs with a scene's contact; what a run asks of Bodies."""
    mesh = wedge_mesh(ALPHA, divisions=(6, 3, 10))
    still = flexible(constrain(assemble(mesh, "blade", Material()), "clamp"))
    damper = flexible(constrain(assemble(mesh, "damper", Material()), None))
    return lambda *given: SimpleNamespace(
        scene=bladefem.load_scene("scenes/wedge.toml", ["contact.bedded=false", STIFF, *given]),
        mesh=mesh,
        seated=still,
        seat_swell=None,
        # at reference temperature
        still_blade=SimpleNamespace(heat=None),
        damper=damper,
    )


@pytest.mark.parametrize(("shift", "error"), [(0.0, 0.01), (0.5, 0.02)])
def test_two_elements_in_the_half_width_give_the_peak(shift, error):
    """The allowed mesh, wherever its nodes lie: 0.8 and 1.7 %; with one element 12 and 28 %."""
    half = graded(A / MIN_ELEMENTS_PER_RADIUS, 2.5 * A, 15 * A, 1.4)
    mesh = facing_blocks(
        np.r_[-half[:0:-1], half], graded(A / MIN_ELEMENTS_PER_RADIUS, 0.5 * A, 15 * A, 1.4)
    )
    patch, e = make_patch(mesh, "this"), modulus(*STEEL)
    C = sum(compliances(mesh, patch, *STEEL, clamped))
    gap = patch_means(patch, mesh).T @ (
        (mesh.points[:, 0] - shift * A / MIN_ELEMENTS_PER_RADIUS) ** 2 / (2 * RADIUS)
    )
    s = solve_lcp(C, gap, -np.ones((len(C), 1)), [-np.pi * e * A**2 / (4 * RADIUS)])
    assert (s.force / patch.area).max() == pytest.approx(e * A / (2 * RADIUS), rel=error)


@pytest.mark.parametrize("dimension", [2, 3])
def test_crowns_too_narrow_for_the_mesh_are_told(dimension):
    """A seat of 30 by 13 mm, or 13 mm on 30 mm of depth, with elements of some 3 mm, pressed with
    80 N.
    """
    mesh = wedge_mesh(ALPHA, divisions=(4, 3, 10), dimension=dimension)
    patch, depth = make_patch(mesh, "this"), mesh.depth if dimension == 2 else 1.0
    maps = {
        load: [PressureMap(patch, load * patch.area / patch.area.sum(), 0 * patch.area, 0.0)]
        for load in (900, 80)
    }

    def micrometres(width):
        return f"{float(f'{1e6 * width:.2g}'):g} um"

    def said(**contact):
        return narrow_sentence(
            maps, Scene(contact=Contact(bedded=False, kn_area=1e16, **contact)), depth
        )

    a = line_width(80 / 0.03, 0.5, contact_modulus(Material(), Material()))
    assert a == pytest.approx(np.sqrt(4 * 80 / 0.03 * 0.5 * 2 * 0.91 / (np.pi * 2.1e11)), rel=1e-12)
    found = said(crown_across=0.5)
    assert (
        f"under 80 N Hertz' contact on the crowned seats has a half width of {micrometres(a)}"
        in found
    )
    assert f"mesh.contact_size <= {micrometres(a / 4)}" in found
    assert (
        said(crown_across=1e4) == said() == narrow_sentence({}, Scene()) == ""
    )  # pressed from end to end, flat
    assert narrow_sentence(maps, Scene(contact=Contact(bedded=True, crown=0.5)), depth) == ""
    if dimension == 3:
        point = point_radius(80, 0.5, contact_modulus(Material(), Material()))
        assert f"half width of {micrometres(point)}" in said(crown=0.5, crown_across=0.5)
        assert said(crown=0.5, crown_across=1e4) == said(crown=0.5) != ""


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_peak_at_a_sharp_edge_is_told(dimension):
    patch = make_patch(wedge_mesh(ALPHA, divisions=(4, 3, 4), dimension=dimension), "this")
    edge = np.argmax(np.linalg.norm(patch.points - patch.points.mean(axis=0), axis=1))
    middle = np.argmin(np.linalg.norm(patch.points - patch.points.mean(axis=0), axis=1))

    def said(top, load=1.0, kn_area=1e15, **contact):
        force = load * patch.area * np.where(np.arange(len(patch.area)) == top, 3.0, 1.0)
        maps = {80.0: [PressureMap(patch, force, 0 * force, 0.0)]}
        return peak_remarks(maps, Scene(contact=Contact(kn_area=kn_area, **contact)))

    assert "under 1 of 1 loads it lies at a sharp edge" in said(edge)[0]
    assert said(middle) == said(edge, 0.0) == []
    assert said(edge, bedded=False, edge_radius=1.0, edge_width=1e-3) == []
    # E* / kn = 2.4 m: the layer spreads the pressure over many elements
    assert said(edge, kn_area=4.8e10) == []


def test_a_circle_smaller_than_its_seat_is_refused():
    mesh = facing_blocks(np.linspace(0, 0.012, 5), np.linspace(0, 0.01, 3), np.linspace(0, 0.02, 5))
    for name, length in (("crown", 20), ("crown_across", 12)):
        with pytest.raises(
            InputError,
            match=rf"contact.{name} = 5 mm: a circle that cannot span the seat of {length}",
        ):
            seat_gap(make_patch(mesh, "this"), mesh, Contact(**{name: 0.005}))
    with pytest.raises(InputError, match="circle that cannot span"):  # before modes and factors
        found_patches(
            Scene(contact=Contact(bedded=False, crown=0.002)), wedge_mesh(ALPHA), excited=False
        )


def seated(bodies, *given, kind=None):
    found = bodies(*given)
    if kind:
        found.scene = SimpleNamespace(
            kind=kind,
            contact=found.scene.contact,
            damper=found.scene.damper,
            material=found.scene.material,
            temperature=found.scene.temperature,
        )
    patches = [make_patch(found.mesh, name) for name in ("this", "next")]
    return solve_seating(seat_damper(found, patches), 0.0, normal=500.0)


def test_a_crowned_damper_presses_in_the_middle(bodies):
    """Equilibrium holds; the ends of the seat open, the pressure moves to the middle and grows."""
    flat, crowned = seated(bodies), seated(bodies, "contact.crown=0.5 m")
    for a, b in zip(flat, crowned, strict=True):
        z = np.abs(b.patch.points[:, 2])
        assert b.force.sum() == pytest.approx(500.0, rel=1e-9)
        assert (b.force[z > 0.014] == 0).all() and (a.force[z > 0.014] > 0).any()
        assert b.force @ z < 0.6 * (a.force @ z)
        assert b.pressure[z < 0.005].max() > 1.5 * a.pressure[z < 0.005].max()
        assert b.complementarity < 1e-9


def test_eased_edges_carry_less(bodies):
    flat, eased = (
        seated(bodies),
        seated(bodies, "contact.edge_radius=20 mm", "contact.edge_width=3 mm"),
    )
    for a, b in zip(flat, eased, strict=True):
        edge = np.abs(b.patch.points[:, 2]) > 0.0149
        assert b.force.sum() == pytest.approx(500.0, rel=1e-9)
        assert b.force[edge].sum() < 0.5 * a.force[edge].sum()


@pytest.mark.parametrize("clearance", ["0.3 mm", "-0.3 mm"])
def test_clearance_and_interference_count_once(bodies, clearance):
    """A drawn wedge has its clearance in the mesh already; on a user's mesh the field moves the
    gap, not the force.
    """
    plain, wide = seated(bodies), seated(bodies, f"damper.clearance={clearance}", kind="imported")
    for a, b in zip(plain, wide, strict=True):
        assert np.abs(a.force - b.force).max() < 1e-7 * a.force.max()
    found = bodies(f"damper.clearance={clearance}")
    patches = [make_patch(found.mesh, "this"), make_patch(found.mesh, "next")]
    assert np.abs(seat_damper(found, patches).clearance).max() < 1e-15
