"""Contact pairs drawn by gmsh and solved by the library's finite elements: flexibilities of the two
bodies together.
"""

from dataclasses import replace

import numpy as np
from scipy.integrate import simpson

from bladefem.contact.complementarity import solve_lcp
from bladefem.contact.partial_slip import slip_step
from bladefem.contact.patch import initial_gap, make_patch, normal_ports, port_matrix
from bladefem.fem.body import assemble
from bladefem.study.kinds.punch import held_port_flexibility
from geometry.contact_pairs import hertz_pair, mesh_punch
from geometry.parameters import HertzPair, MeshSize, Punch


def pair_flexibility(mesh, patch, materials, tangential=False):
    """(n, n) at the normal ports, or along t1 (the x axis) with x = 0 an antisymmetry plane [m/N];
    None is rigid.
    """
    if tangential:
        faces = {k: v for k, v in mesh.faces.items() if k != "symmetry_x"}
        mesh = replace(mesh, faces={**faces, "antisymmetry_x": mesh.faces["symmetry_x"]})
    columns = normal_ports([patch], mesh) + int(tangential)
    C = np.zeros((len(columns),) * 2)
    for side, clamp, material in zip(
        ("blade", "damper"), ("clamp", "load"), materials, strict=True
    ):
        if material is not None:
            body = assemble(mesh, side, material)
            C += held_port_flexibility(body, port_matrix([patch], mesh, side)[:, columns], clamp)
    return C


def modulus(materials, dimension=3):
    """E*, in plane models that of plane stress."""
    return 1 / sum((1 - m.nu**2 * (dimension == 3)) / m.E for m in materials if m is not None)


def press(n, materials, dimension=3, **sizes):
    """A quarter of a sphere (half of a cylinder) pressed to the expected radius, elements a/n:
    errors and arrays.
    """
    hertz = HertzPair(dimension=dimension, **sizes)
    a, R, e = hertz.contact_radius, hertz.radius, modulus(materials, dimension)
    mesh = hertz_pair(hertz, MeshSize(contact_size=a / n))
    patch = make_patch(mesh, "this")
    r, area = np.linalg.norm(patch.points[:, : dimension - 1], axis=1), patch.area
    force, peak = (
        (e * a**3 / (3 * R), 2 * e * a / (np.pi * R))
        if dimension == 3
        else (np.pi * e * a**2 / (8 * R), e * a / (2 * R))
    )
    C = pair_flexibility(mesh, patch, materials)
    s = solve_lcp(C, initial_gap(patch, mesh), -np.ones((len(C), 1)), [-force])
    assert s.reason == "" and s.residual < 1e-9
    p, exact = s.force / area, peak * np.sqrt(np.clip(1 - (r / a) ** 2, 0, None))
    return {
        "peak": abs(p.max() / peak - 1),
        "L2": np.sqrt(area @ (p - exact) ** 2 / (area @ exact**2)),
        "radius": abs(np.sqrt(s.force @ r**2 / force * (2.5 if dimension == 3 else 4)) / a - 1),
        "mesh": mesh,
        "patch": patch,
        "force": s.force,
        "r": r,
        "a": a,
        "total": force,
    }


def indent(n, material, dimension=3):
    """A rigid flat punch, elements a/n: L2 error of the pressure for r < 0.8 a."""
    shape = Punch(dimension=dimension)
    a, mesh = shape.radius, mesh_punch(shape, MeshSize(contact_size=shape.radius / n))
    patch = make_patch(mesh, "this")
    r, area = np.linalg.norm(patch.points[:, : dimension - 1], axis=1), patch.area
    C = pair_flexibility(mesh, patch, (material, None))
    s = solve_lcp(C, np.zeros(len(C)), -np.ones((len(C), 1)), [-1.0 if dimension == 3 else -0.5])
    assert s.reason == "" and s.active.all()
    inner = r < 0.8 * a
    root = np.sqrt(a**2 - r[inner] ** 2)
    exact = 4 / (2 * np.pi * a * root) if dimension == 3 else 1 / (np.pi * root)
    p = (s.force / area)[inner]
    return np.sqrt(area[inner] @ (p - exact) ** 2 / (area[inner] @ exact**2))


def loops(pressed, material, ratios, mu=0.3):
    """Partial slip under Q = ratio mu P, two equal bodies: relative errors (stick radius, energy of
    a loop).

    Mindlin and Deresiewicz 1953, doi:10.1115/1.4010702: c / a = (1 - Q / mu P)^(1/3), the first
    loading is shift = 3 mu P / (16 a G*) (1 - (1 - Q / mu P)^(2/3)), 1 / G* = 2 (2 - nu) / G; the
    loop follows by Masing. The stick radius comes from the second moment of mu p - q, which is a
    Hertz pressure over the stick zone.
    """
    mesh, patch, a = pressed["mesh"], pressed["patch"], pressed["a"]
    C = pair_flexibility(mesh, patch, (material, material), tangential=True)
    limit, most = mu * pressed["force"], mu * pressed["total"]
    G = material.E / (4 * (2 - material.nu) * (1 + material.nu))
    out = []
    for ratio in ratios:
        state = slip_step(C, limit, total=ratio * most)
        rest = limit - state.force
        radius = np.sqrt(2.5 * (rest @ pressed["r"] ** 2) / rest.sum())
        energy = 0.0
        for x in np.r_[np.linspace(1, -1, 9)[1:], np.linspace(-1, 1, 9)[1:]]:
            state = slip_step(C, limit, state, total=x * ratio * most)
            energy += state.work
        q = np.linspace(0, ratio, 4001)
        law = (
            3 * 4 * most / (16 * a * G) * (1 - (1 - q) ** (2 / 3))
        )  # the quarter carries a quarter of the force
        exact = 8 * most * (0.5 * ratio * law[-1] - simpson(law, q))
        out.append((radius / a / (1 - ratio) ** (1 / 3) - 1, energy / exact - 1))
    return out
