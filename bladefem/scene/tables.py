"""A scene: everything that an engineer decides, as frozen dataclasses in SI units. Reading TOML is
in toml.py.

Numerical settings that are ``None`` are chosen by error indicators from ``accuracy``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

from geometry.parameters import (
    Aerofoil,
    Disc,
    HertzPair,
    MeshSize,
    Plane,
    Platform,
    Punch,
    Root,
    Shank,
    Shroud,
    Wedge,
    ZMass,
)
from geometry.quantity import quantity


@dataclass(frozen=True)
class Material:
    """Linear elastic: isotropic, cubic (with G) or orthotropic. The default is a steel."""

    E: float = quantity(2.1e11, "Pa", 1e6, 1e13, "Young's modulus")
    nu: float = quantity(0.3, "1", -0.99, 0.499, "Poisson's ratio")
    rho: float = quantity(7850.0, "kg/m^3", 1.0, 3e4, "density")
    G: float | None = quantity(
        None,
        "Pa",
        1e6,
        1e13,
        "shear modulus of a cubic crystal, with E along its edges; isotropic when left out",
    )
    orthotropic: tuple[float, ...] | None = quantity(
        None,
        "1",
        help="E1, E2, E3 [Pa], nu12, nu13, nu23, G12, G13, G23 [Pa] of an orthotropic solid, in "
        "place of E, nu and G",
    )
    angles: tuple[float, float, float] = quantity(
        (0.0, 0.0, 0.0),
        "rad",
        -2 * pi,
        2 * pi,
        "of the crystal: about the blade's x (radial), the new y, the new z",
    )
    expansion: float | None = quantity(
        None,
        "1/K",
        -1e-4,
        1e-3,
        "thermal expansion, mean coefficient from temperature.reference; needed where the "
        "temperature is another one",
    )
    expansion_axes: tuple[float, float, float] | None = quantity(
        None,
        "1/K",
        -1e-4,
        1e-3,
        "thermal expansion along the three axes of the crystal, in place of expansion",
    )
    table: tuple[str, ...] | None = quantity(
        None,
        help="rows of properties over temperature, such as '600 degC: E=180 GPa; nu=0.31; "
        "expansion=1.4e-5 1/K', linear in between; what no row gives stays constant",
    )


@dataclass(frozen=True)
class Materials:
    """One material a body."""

    blade: Material = field(default_factory=Material)
    damper: Material = field(default_factory=Material)


@dataclass(frozen=True)
class Seat:
    """One seat's own values, where the two differ; what is left out is as in [contact]."""

    mu: float | None = quantity(
        None, "1", 0.0, 2.0, "friction coefficient of this seat; contact.mu when left out"
    )
    kt_area: float | None = quantity(
        None, "N/m^3", 1.0, 1e15, "its tangential stiffness per unit area"
    )
    kt: float | None = quantity(None, "N/m", 1.0, 1e12, "its whole tangential stiffness")
    kn_area: float | None = quantity(None, "N/m^3", 1.0, 1e15, "its normal stiffness per unit area")
    kn: float | None = quantity(None, "N/m", 1.0, 1e12, "its whole normal stiffness")


@dataclass(frozen=True)
class Contact:
    """Friction, contact stiffness, shape and wear of the seats. Areal stiffnesses spread over the
    patch; totals win.
    """

    mu: float = quantity(0.3, "1", 0.0, 2.0, "friction coefficient")
    kt_area: float | None = quantity(
        None,
        "N/m^3",
        1.0,
        1e15,
        "tangential contact stiffness per unit area; by Mindlin from the normal one, and from "
        "roughness and pressure without either",
    )
    kt: float | None = quantity(
        None, "N/m", 1.0, 1e12, "tangential stiffness of one whole patch, in place of kt_area"
    )
    kn_area: float | None = quantity(
        None,
        "N/m^3",
        1.0,
        1e15,
        "normal contact stiffness per unit area; by Mindlin from the tangential",
    )
    kn: float | None = quantity(
        None, "N/m", 1.0, 1e12, "normal stiffness of one whole patch, in place of kn_area"
    )
    roughness: float | None = quantity(
        None,
        "m",
        1e-8,
        1e-4,
        "mean roughness Ra of each face, where no stiffness is given: k_n = pressure / (0.4 times "
        "the rms roughness of both faces); 0.8 um (ground) when left out",
    )
    stiffness: str = quantity(
        "given",
        choices=("given", "rigid", "map"),
        help="normal stiffness: of one interface layer for seating and vibration, as given above; "
        "rigid faces in both; "
        "or of each node from the pressure map between rigid faces, its static force over the "
        "approach of the bodies there (Eq. 23 of doi:10.1007/s11071-016-3239-6)",
    )
    stiffening: float | None = quantity(
        None,
        "Pa",
        1.0,
        1e12,
        "pressure at which the layer is twice as stiff as at first touch; a linear layer when "
        "left out",
    )
    points: int | None = quantity(
        None,
        "1",
        1,
        5000,
        "friction elements on each patch; chosen by error indicators when left out",
    )
    bedded: bool = quantity(
        True, help="seats have worn until they fit at the operating speed; false: as drawn"
    )
    normal: str = quantity(
        "coupled",
        choices=("coupled", "prescribed"),
        help="normal load follows the motion, or stays at its static value",
    )
    history: str | tuple[float, ...] = quantity(
        "frictionless",
        "rad/s",
        0.0,
        1e5,
        choices=("frictionless", "spin-up"),
        help="how the damper came to its seats: without friction; by spinning up from rest with "
        "it; or through a list of speeds from rest, at last operation.speed",
    )
    crown: float | None = quantity(
        None, "m", 1e-3, 1e4, "radius of crowned seats along the engine axis; flat when left out"
    )
    crown_across: float | None = quantity(
        None, "m", 1e-3, 1e4, "radius of crowned seats along the slope; flat when left out"
    )
    edge_radius: float | None = quantity(
        None, "m", 1e-3, 1e4, "radius of the seats' edges, eased; sharp when left out"
    )
    edge_width: float | None = quantity(
        None, "m", 1e-5, 0.1, "width of the eased strip along the edges"
    )
    wear_coefficient: float | None = quantity(
        None,
        "m^3/J",
        0.0,
        1e-6,
        "worn volume for each joule of friction work (m^3/J is m^2/N); Archard's coefficient over "
        "mu",
    )
    left: Seat = field(default_factory=Seat)
    right: Seat = field(default_factory=Seat)


@dataclass(frozen=True)
class Operation:
    """Where the engine runs."""

    speed: float = quantity(8000 * 2 * pi / 60, "rad/s", 0.0, 1e5, "rotational speed")
    stiffening: bool = quantity(
        True, help="centrifugal stress stiffening and spin softening in the modes"
    )
    preload: str = quantity(
        "linear",
        choices=("linear", "nonlinear"),
        help="state that the modes vibrate about, and that seats and static stresses are of: "
        "first-order, or with large displacements",
    )
    coriolis: bool | None = quantity(
        None,
        help="Coriolis forces in responses; auto: where they move the mode studied by more than a "
        "tenth of the accuracy",
    )
    damping: float = quantity(
        0.001, "1", 0.0, 0.5, "modal damping ratio of all modes without friction"
    )


@dataclass(frozen=True)
class Temperature:
    """How hot the bodies are. Nothing given: properties at reference temperature, no thermal
    stress.
    """

    uniform: float | None = quantity(
        None, "K", 0.0, 5000.0, "of blade and damper, such as '650 degC'"
    )
    file: str = quantity(
        "",
        help="CSV file of places and temperatures, columns x, y, z, T with units in brackets such "
        "as 'T [degC]' (m and K without), interpolated, in the axes of imported.file; or columns "
        "node, T with the numbers of that mesh; relative to the scene file",
    )
    reference: float = quantity(
        293.15, "K", 0.0, 5000.0, "at which the bodies are as drawn and free of thermal stress"
    )


@dataclass(frozen=True)
class Excitation:
    """A force pattern of one engine order, turning round the wheel."""

    engine_order: int = quantity(6, "1", 0, 1000, "cycles of the pattern in one revolution")
    force: float = quantity(1.0, "N", 0.0, 1e6, "amplitude on each blade")
    at: str = quantity("tip_mid", help="named node set or face that carries the force")
    direction: tuple[float, float, float] = quantity(
        (0.0, 1.0, 0.0),
        "1",
        help="direction in the blade's own axes (radial, circumferential, axial)",
    )
    phase: float = quantity(
        0.0,
        "rad",
        -pi,
        pi,
        "inter-blade phase of plane blades; on a wheel it follows from the engine order",
    )
    mode: int = quantity(1, "1", 1, 50, "mode whose resonance is studied, 1 = lowest")


@dataclass(frozen=True)
class Study:
    """What is varied. Loads are the static normal force between damper and one seat."""

    loads: tuple[float, ...] | None = quantity(
        None,
        "N",
        0.0,
        1e8,
        "normal loads per seat; from an eighth of the best one to thirty times it when left out",
    )
    own_load: bool = quantity(
        False, help="also the load that the damper's own mass makes at the operating speed"
    )
    masses: tuple[float, ...] | None = quantity(
        None, "kg", 1e-5, 10.0, "damper masses; the scene's own when left out"
    )
    band: tuple[float, float] | None = quantity(
        None, "Hz", 0.0, 1e6, "frequency band; from the free to the stuck resonance when left out"
    )
    influences: bool = quantity(
        True,
        help="also what the best load depends on: contact stiffness, friction, damping, and "
        "friction while seating, each over its range",
    )
    interval: bool = quantity(
        False,
        help="also the lowest and highest resonance over all friction forces that the loading "
        "history may have left in contact points that never slip",
    )
    stability: bool = quantity(
        True,
        help="Floquet multipliers of the points of each curve, where normal loads follow the "
        "motion: unstable ones are marked and are no resonance; of a wheel the lowest resonance is "
        "judged in every nodal diameter",
    )


@dataclass(frozen=True)
class Mistuning:
    """Blades that are not alike: a measured pattern, or a scatter; of wheels with all sectors."""

    pattern: str | None = quantity(
        None,
        help="CSV file of relative deviations of blade-alone frequencies, one row a blade, one "
        "column a family, or of their stiffness and mass by columns like '1F stiffness' and "
        "'mass'; relative to the scene file",
    )
    scatter: float | None = quantity(
        None,
        "1",
        0.0,
        0.3,
        "relative standard deviation of the blade-alone frequencies; draws the pattern of a run "
        "without a file, and those of 'bladefem scatter'",
    )
    friction: float = quantity(
        0.0, "1", 0.0, 0.3, "relative standard deviation of the dampers' friction coefficients"
    )
    stiffness: float = quantity(
        0.0, "1", 0.0, 0.3, "relative standard deviation of the dampers' contact stiffnesses"
    )
    load: float = quantity(
        0.0, "1", 0.0, 0.3, "relative standard deviation of the dampers' normal loads"
    )
    mass: float = quantity(
        0.0,
        "1",
        0.0,
        0.3,
        "relative standard deviation of the dampers' masses, with their inertia and the normal "
        "load that it makes",
    )
    traction: float = quantity(
        0.0,
        "1",
        0.0,
        1.0,
        "largest share of Coulomb's limit that the loading history leaves in the contacts of a "
        "damper, in a direction of its own",
    )
    seed: int = quantity(0, "1", 0, 1000000, "of the draws")
    wheels: int = quantity(30, "1", 2, 100000, "drawn by 'bladefem scatter' for each load")
    level: str = quantity(
        "whole wheel",
        choices=("whole wheel", "damper law"),
        help="how 'bladefem scatter' solves its wheels: each in full, or all by the law of one "
        "damper, some of them checked in full",
    )
    checks: int = quantity(
        4, "1", 2, 1000, "wheels of each load that are solved in full where the damper law is asked"
    )
    families: int = quantity(3, "1", 1, 10, "blade-alone modes that deviate")
    blades: tuple[str, ...] | None = quantity(
        None,
        help="blades of another shape, by number from 1, texts like '7: aerofoil.chord_tip = 41 "
        "mm; aerofoil.twist = 21 deg', of an imported blade '7: imported.file = other.msh'",
    )
    orders: tuple[str, ...] | None = quantity(
        None,
        help="further engine orders, as texts like '18: 0.3 N; 90 deg'",
    )


@dataclass(frozen=True)
class Aerodynamics:
    """What the flow does to the mode studied, by nodal diameter or by the distance of blades; of
    wheels. Shares of the mode's own frequency and of critical damping.
    """

    waves: tuple[str, ...] | None = quantity(
        None,
        help="damping and frequency shift of waves, texts like '-5: -0.12 %; 0.05 %' (nodal "
        "diameter: positive ones run against the rotation, as engine orders up to half the number "
        "of blades do, negative ones with it); linear between those given",
    )
    influence: tuple[str, ...] | None = quantity(
        None,
        help="in place of them influence coefficients, texts like '-1: 0.08 %; 120 deg': force on "
        "a blade by the motion of the one that many places ahead, over twice the modal stiffness; "
        "90 deg damps",
    )


@dataclass(frozen=True)
class Fatigue:
    """What the blade's material lasts: Goodman's line by two values, or Haigh's diagram."""

    endurance: float | None = quantity(
        None, "Pa", 1e5, 1e11, "stress amplitude that lasts without mean stress"
    )
    ultimate: float | None = quantity(
        None, "Pa", 1e5, 1e11, "mean stress at which no amplitude lasts: ultimate strength"
    )
    haigh: tuple[str, ...] | None = quantity(
        None,
        help="mean stresses and the amplitudes that last there, texts like '200 MPa: 150 MPa'; in "
        "place of the two values",
    )


@dataclass(frozen=True)
class Model:
    """Numerical settings. None: chosen by error indicators so that the answer keeps the scene's
    accuracy.
    """

    modes: int | None = quantity(
        None,
        "1",
        1,
        500,
        "modes kept in each nodal diameter; chosen by error indicators when left out",
    )
    harmonics: int | None = quantity(
        None, "1", 1, 99, "harmonics of the balance; chosen by error indicators when left out"
    )
    samples: int | None = quantity(
        None,
        "1",
        0,
        65536,
        "time samples a period; chosen by error indicators when left out; 0: changes of contact "
        "state are located exactly (plane blades)",
    )
    damper: str | None = quantity(
        None,
        choices=("mass", "rigid", "elastic"),
        help="damper model; chosen by error indicators when left out",
    )
    static: str = quantity(
        "coupled",
        choices=("coupled", "uncoupled"),
        help="the mean displacements take part in the balance, or stay as the static contact "
        "solution left them",
    )
    reduction: str = quantity("rubin", choices=("rubin", "craig-bampton"), help="reduction basis")
    nodal_diameters: tuple[int, ...] | None = quantity(
        None,
        "1",
        0,
        1000,
        "nodal diameters of the mode tables; when left out those that the engine order excites "
        "('bladefem modes': all)",
    )


@dataclass(frozen=True)
class Support:
    """How the blade or sector is held."""

    clamp: str = quantity(
        "clamp", help="face or node set that is held fast; '' for none: free, or on springs"
    )
    springs: tuple[str, ...] | None = quantity(
        None,
        help="springs to the ground per unit area of faces, such as "
        "'root: normal=1e12 N/m^3; tangential=5e11 N/m^3'",
    )
    directions: tuple[str, ...] | None = quantity(
        None,
        help="single displacements that are zero on faces or node sets, such as 'rim: z', "
        "'foot: xy' (x radial, y circumferential at the middle of the sector, z axial) or "
        "'bore: ra' (at each node r radial, t tangential, a axial about the z axis)",
    )


@dataclass(frozen=True)
class Solver:
    """How eigenvalue problems are solved."""

    eigensolver: str = quantity(
        "slepc",
        choices=("slepc", "lanczos"),
        help="SLEPc's Krylov-Schur iteration, or the block Lanczos iteration that finishes guesses",
    )
    vectors: int | None = quantity(
        None, "1", 3, 5000, "basis vectors of SLEPc; twice the modes and two when left out"
    )
    petsc: str = quantity(
        "",
        help="PETSc and SLEPc options, such as '-eps_monitor'; also after -- on the command line",
    )


@dataclass(frozen=True)
class Foundation:
    """The supports of the Z-shaped mass, how they move, and what presses and pulls: Eq. 30 and
    Table 1 of doi:10.1007/s11071-016-3239-6.
    """

    depth: float = quantity(
        0.06, "m", 0.002, 1.0, "of the elastic block below, clamped at its bottom"
    )
    frequency: float = quantity(100.0, "Hz", 1e-2, 1e5, "of its motion")
    amplitude: tuple[float, float] = quantity(
        (0.005, 0.0), "m", 0.0, 0.1, "of its motion along x and y"
    )
    phase: float = quantity(pi / 2, "rad", -pi, pi, "of the motion along y against that along x")
    ratios: tuple[float, ...] = quantity(
        (0.0, 0.25, 0.5, 2.0),
        "1",
        0.0,
        20.0,
        "frequencies of the normal load over that of the motion",
    )
    pulsation: float = quantity(
        30.0, "N", 0.0, 1e6, "amplitude of the normal load about study.loads"
    )
    skew: tuple[float, float] = quantity(
        (0.0, 0.0),
        "1",
        -1.0,
        1.0,
        "growth of the pressure on the top from the centre to the ends, along x and y",
    )
    pull: tuple[float, float] = quantity(
        (0.0, 0.0), "N", -1e5, 1e5, "steady force on the mass along x and y"
    )


@dataclass(frozen=True)
class Imported:
    """A user's own mesh (.msh with named groups, and what meshio reads) or STEP file."""

    file: str = quantity("", help="path, relative to the scene file")
    scale: float = quantity(1.0, "1", 1e-9, 1e9, "factor from the file's length unit to metres")
    sectors: int = quantity(
        0, "1", 0, 1000, "number of sectors; 0 for a single body without cyclic faces"
    )
    axis: tuple[float, float, float] = quantity(
        (0.0, 0.0, 1.0), "1", help="engine axis through the origin"
    )
    materials: tuple[str, ...] | None = quantity(
        None,
        help="materials of named volumes: 'disc: E=114 GPa; nu=0.34; rho=4430 kg/m^3'; rows over "
        "temperature as 'disc at 600 degC: E=90 GPa'",
    )
    names: tuple[str, ...] | None = quantity(
        None,
        help="names for groups, node sets and surfaces of the file that has others, such as "
        "'clamp = face_3 + face_4', 'tip = face_1'",
    )
    seats: tuple[str, str] | None = quantity(
        None,
        help="plane platform faces of a STEP blade, towards the next blade and towards the "
        "previous one, between which [damper] is drawn; seats are cut into them",
    )
    seat_width: float | None = quantity(
        None,
        "m",
        1e-4,
        0.1,
        "width of these seats, from the platform's edge inwards; the whole face when left out",
    )
    linear: str = quantity(
        "refuse",
        choices=("refuse", "promote", "keep"),
        help="first-order solids: refused, promoted to second order (nodes in the middle of "
        "straight edges), or solved as they are, far too stiff",
    )
    tolerance: float = quantity(
        1e-4, "1", 1e-9, 0.05, "largest distance of matched nodes, as a share of the face's size"
    )
    cut_gap: float = quantity(
        1e-3,
        "1",
        0.0,
        0.05,
        "largest gap between cut faces whose nodes do not match, as a share of the face's size; "
        "within it a mortar ties them",
    )
    more: tuple[str, ...] | None = quantity(
        None, help="other files of the same model, such as 'damper = damper.inp'"
    )


@dataclass(frozen=True)
class Scene:
    """All of it. Tables that a kind does not use must not be given."""

    title: str = quantity("untitled", help="shown on pictures and in the report")
    kind: str = quantity("wedge sector", help="which geometry, see scene.kinds")
    accuracy: float = quantity(
        0.02, "1", 1e-6, 0.5, "wanted relative accuracy of the resonance amplitude"
    )
    aerofoil: Aerofoil = field(default_factory=Aerofoil)
    platform: Platform = field(default_factory=Platform)
    shank: Shank = field(default_factory=Shank)
    disc: Disc = field(default_factory=Disc)
    root: Root = field(default_factory=Root)
    shroud: Shroud = field(default_factory=Shroud)
    damper: Wedge = field(default_factory=Wedge)
    plane: Plane = field(default_factory=Plane)
    z_mass: ZMass = field(default_factory=ZMass)
    foundation: Foundation = field(default_factory=Foundation)
    hertz: HertzPair = field(default_factory=HertzPair)
    punch: Punch = field(default_factory=Punch)
    imported: Imported = field(default_factory=Imported)
    mesh: MeshSize = field(default_factory=MeshSize)
    material: Materials = field(default_factory=Materials)
    contact: Contact = field(default_factory=Contact)
    operation: Operation = field(default_factory=Operation)
    temperature: Temperature = field(default_factory=Temperature)
    excitation: Excitation = field(default_factory=Excitation)
    study: Study = field(default_factory=Study)
    mistuning: Mistuning = field(default_factory=Mistuning)
    aerodynamics: Aerodynamics = field(default_factory=Aerodynamics)
    fatigue: Fatigue = field(default_factory=Fatigue)
    model: Model = field(default_factory=Model)
    solver: Solver = field(default_factory=Solver)
    support: Support = field(default_factory=Support)
