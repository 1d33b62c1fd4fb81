"""The parameters of every shape that bladefem can draw. SI units, radians; no gmsh here.

Axes, everywhere: z is the engine axis, the middle of a blade is along +x (radial), y is
circumferential. A sector spans the angles -pi/N .. +pi/N about z; the next blade is the sector
turned by +2 pi/N. Plane models lie in x (radial), y (circumferential); z is their out-of-plane
thickness; the next blade is at +pitch in y.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from .damper_shapes import SHAPES
from .quantity import quantity

DEG = pi / 180
# cells of a mesh; far beyond what one machine solves
MAX_CELLS = 3e6


@dataclass(frozen=True)
class Aerofoil:
    """The blade above its platform, a closed spline section lofted from root to tip."""

    span: float = quantity(0.12, "m", 0.02, 1.0, "height from platform to tip")
    chord_root: float = quantity(0.05, "m", 0.01, 0.5, "chord at the platform")
    chord_tip: float = quantity(0.042, "m", 0.005, 0.5, "chord at the tip")
    thickness_root: float = quantity(0.14, "1", 0.04, 0.4, "largest thickness over chord, root")
    thickness_tip: float = quantity(0.08, "1", 0.03, 0.4, "largest thickness over chord, tip")
    camber: float = quantity(0.08, "1", 0.0, 0.25, "camber over chord")
    section: str = quantity("naca", choices=("naca", "biconvex"), help="section family")
    stagger: float = quantity(
        25 * DEG, "rad", -70 * DEG, 70 * DEG, "angle of the root chord to the engine axis"
    )
    twist: float = quantity(
        20 * DEG, "rad", -60 * DEG, 60 * DEG, "turn of the tip section against the root section"
    )
    lean: float = quantity(
        0.0, "rad", -20 * DEG, 20 * DEG, "tilt of the stacking line, circumferential"
    )
    sweep: float = quantity(0.0, "rad", -20 * DEG, 20 * DEG, "tilt of the stacking line, axial")
    fillet: float | None = quantity(
        None,
        "m",
        0.0,
        0.01,
        "radius between aerofoil and platform, 0 for a sharp edge; 0.3 of the root's thickness "
        "when left out, none where the elements asked for are larger than twice that",
    )

    @property
    def fillet_radius(self) -> float:
        """0 where it is still open [m], see `geometry.fillet`."""
        return self.fillet or 0.0


@dataclass(frozen=True)
class Platform:
    """The plate that carries the aerofoil; its two inclined undersides are the seats of the
    dampers.
    """

    length: float = quantity(0.06, "m", 0.01, 0.5, "axial length")
    thickness: float = quantity(0.006, "m", 0.002, 0.05, "thickness at the rim of the plate")
    gap: float = quantity(
        0.001, "m", 1e-4, 0.02, "circumferential gap between neighbouring platforms"
    )
    seat_width: float = quantity(
        0.006, "m", 0.002, 0.05, "width of the inclined seat, along the slope"
    )


@dataclass(frozen=True)
class Shank:
    """The neck between platform and disc."""

    height: float = quantity(0.03, "m", 0.005, 0.2, "from the rim of the disc to the platform")
    width: float = quantity(0.016, "m", 0.004, 0.1, "circumferential width")
    length: float = quantity(0.045, "m", 0.01, 0.4, "axial length")


@dataclass(frozen=True)
class Disc:
    """The segment of the disc below one blade, clamped at its bore."""

    sectors: int = quantity(36, "1", 6, 200, "number of blades")
    bore_radius: float = quantity(0.12, "m", 0.01, 2.0, "inner radius, clamped")
    rim_radius: float = quantity(0.2, "m", 0.03, 3.0, "outer radius, where the shank starts")
    width: float = quantity(0.045, "m", 0.01, 0.5, "axial width")


@dataclass(frozen=True)
class Root:
    """How the blade sits in the disc: on a plain rim, or in a dovetail or fir-tree whose bearing
    flanks are taken as bonded; slots part blade and disc elsewhere.
    """

    lobes: int = quantity(
        0, "1", 0, 5, "0: plain, the shank grows out of the rim; 1: dovetail; 2 and more: fir-tree"
    )
    neck: float | None = quantity(
        None, "m", 0.002, 0.2, "width of the uppermost neck, at the rim; shank.width when left out"
    )
    pitch: float = quantity(0.006, "m", 0.001, 0.1, "radial distance from lobe to lobe")
    bearing: float = quantity(
        0.003, "m", 5e-4, 0.05, "width of each bearing flank, along its slope"
    )
    flank_angle: float = quantity(
        50 * DEG, "rad", 20 * DEG, 75 * DEG, "of the bearing flanks against the radial direction"
    )
    taper: float = quantity(
        8 * DEG, "rad", 0.0, 30 * DEG, "half angle by which deeper necks become narrower"
    )
    clearance: float = quantity(
        8e-4, "m", 1e-4, 0.01, "of the slots, along the bearing flanks where these end"
    )


@dataclass(frozen=True)
class Shroud:
    """A block on the aerofoil, one solid with it and free between neighbours: a tip shroud, or a
    snubber part of the way up.
    """

    thickness: float = quantity(0.0, "m", 0.0, 0.05, "radial thickness; 0: no shroud")
    at: float = quantity(
        1.0,
        "1",
        0.3,
        1.0,
        "share of the span: 1 ends at the tip and covers it, less is the middle of a snubber, "
        "which leaves leading and trailing edge free",
    )
    length: float | None = quantity(
        None,
        "m",
        0.002,
        0.5,
        "axial length; when left out what covers the tip section, or a third of the section's "
        "axial extent for a snubber",
    )
    width: float | None = quantity(
        None, "m", 0.002, 0.5, "circumferential width; up to the gap when left out"
    )
    gap: float = quantity(0.001, "m", 1e-4, 0.05, "to the next shroud, at least")


@dataclass(frozen=True)
class Wedge:
    """The underplatform damper: a prism with two plane flanks, pressed outwards between two
    platforms.
    """

    shape: str = quantity("wedge", choices=tuple(SHAPES), help="what its section looks like")
    angle: float = quantity(
        40 * DEG,
        "rad",
        15 * DEG,
        90 * DEG,
        "alpha: each flank against the radial plane between two blades; 90 deg for a plate",
    )
    angle_next: float | None = quantity(
        None,
        "rad",
        15 * DEG,
        75 * DEG,
        "of the flank under the next blade, for an asymmetric wedge; as angle when left out",
    )
    length: float = quantity(0.04, "m", 0.005, 0.5, "axial length")
    base: float = quantity(
        0.002,
        "m",
        2e-4,
        0.05,
        "height of the straight part below the flanks of a wedge (the blunted bottom); the "
        "thickness of a plate",
    )
    mass: float | None = quantity(None, "kg", 1e-4, 5.0, "mass; sets the density when given")
    clearance: float = quantity(
        0.0,
        "m",
        -5e-4,
        0.002,
        "normal gap between flank and seat before seating; negative: an interference, which the "
        "damper takes up as it travels inwards",
    )
    axial: str = quantity(
        "free",
        choices=("free", "held"),
        help="motion of the damper along the engine axis: left to friction, or held by a stop such "
        "as a cover plate; it may turn in both cases",
    )

    @property
    def angles(self) -> tuple[float, float]:
        """Of the flanks under this blade and under the next one [rad]."""
        return self.angle, self.angle if self.angle_next is None else self.angle_next


@dataclass(frozen=True)
class Plane:
    """Plane blades with flat dampers (the paper's Fig. 12): clamped at x = 0, platforms at a
    height.
    """

    length: float = quantity(0.15, "m", 0.02, 1.0, "blade length from root to tip")
    thickness: float = quantity(0.006, "m", 0.001, 0.1, "blade thickness, circumferential")
    depth: float = quantity(0.03, "m", 0.001, 0.5, "out-of-plane thickness")
    platform_height: float = quantity(0.045, "m", 0.005, 0.9, "height of the platform's underside")
    platform_width: float = quantity(0.05, "m", 0.005, 0.5, "circumferential width of the platform")
    platform_thickness: float = quantity(0.008, "m", 0.001, 0.1, "radial thickness of the platform")
    pitch: float = quantity(0.054, "m", 0.006, 0.6, "distance between two blades")
    seat_width: float = quantity(
        0.012, "m", 0.002, 0.2, "contact width on each platform, from its edge"
    )
    damper_mass: float = quantity(0.06, "kg", 1e-4, 5.0, "mass of a flat damper")
    damper_height: float = quantity(0.006, "m", 0.001, 0.1, "radial height of the flat damper")


@dataclass(frozen=True)
class ZMass:
    """The Z-shaped mass on a vibrating foundation (the paper's Sect. 4), three bars of one
    plate.
    """

    width: float = quantity(0.06, "m", 0.01, 0.5, "along x")
    height: float = quantity(0.06, "m", 0.01, 0.5, "along y")
    bar: float = quantity(0.016, "m", 0.003, 0.2, "width of the three bars")
    thickness: float = quantity(0.01, "m", 0.001, 0.1, "of the plate, along z")


@dataclass(frozen=True)
class HertzPair:
    """A sphere (3-D) or cylinder (plane strain) cap against a block, symmetric halves; for
    verification.
    """

    radius: float = quantity(0.05, "m", 0.001, 1.0, "radius of curvature of the indenter")
    half_width: float = quantity(0.01, "m", 1e-4, 1.0, "half width of the meshed blocks")
    contact_radius: float = quantity(1e-3, "m", 1e-5, 0.1, "expected contact radius, meshed finely")
    dimension: int = quantity(
        3, "1", 2, 3, "3 for a sphere, 2 for a cylinder in plane strain, loads on a metre of it"
    )
    interference: float | None = quantity(
        None,
        "m",
        1e-9,
        0.01,
        "how far the far faces are held closer than where the bodies touch, in place of "
        "study.loads",
    )


@dataclass(frozen=True)
class Punch:
    """A flat rigid punch on an elastic block; for verification."""

    radius: float = quantity(2e-3, "m", 1e-5, 0.1, "radius (3-D) or half width (2-D) of the punch")
    half_width: float = quantity(0.02, "m", 1e-4, 1.0, "half width of the block")
    dimension: int = quantity(
        3, "1", 2, 3, "3 for a round punch, 2 for plane strain, loads on a metre of depth"
    )
    interference: float | None = quantity(
        None,
        "m",
        1e-9,
        0.01,
        "how far the punch is held inside of the block's face, in place of study.loads",
    )


@dataclass(frozen=True)
class MeshSize:
    """How finely a shape is meshed."""

    size: float | None = quantity(
        None, "m", 1e-5, 1.0, "target element size; from the thinnest part when left out"
    )
    contact_size: float | None = quantity(None, "m", 1e-6, 1.0, "element size on contact faces")
    seat_elements: int | None = quantity(
        None,
        "1",
        2,
        64,
        "elements across the width of a wedge's seats, a grid with contact_size, or a sixth of "
        "the length and at most 12 times damper.base, along them; 8 when left out, free triangles "
        "where contact_size alone is given",
    )
    fillet_elements: int | None = quantity(
        None,
        "1",
        1,
        64,
        "elements over the arc of a fillet; 4 when left out, in proportion where size is given",
    )
    order: int = quantity(2, "1", 1, 2, "order of the elements; 1 is only for comparison")
    algorithm: str = quantity(
        "delaunay",
        choices=("delaunay", "hxt"),
        help="how gmsh fills volumes; the other one is tried when it fails or leaves poor cells",
    )
    scale: float = quantity(
        1.0, "1", 0.02, 50.0, "factor on all element sizes, also those that are left open"
    )
    curved: bool = quantity(
        True, help="second-order elements follow curved faces (invalid ones are straightened)"
    )
