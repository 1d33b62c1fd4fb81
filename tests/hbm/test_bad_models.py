"""Wrong input is refused in one sentence that names the field, before anything is solved."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.data import Elements, RigidBody
from bladefem.errors import InputError
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.optimum import optimum
from bladefem.hbm.parameters import vary
from bladefem.hbm.peak import find_peak
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.sweep import sweep
from bladefem.reduction.matrices import port_model_from_matrices

MODEL = single_mass()
E, SIDE = MODEL.elements, MODEL.side(1)
PORTS = {"contact": [0], "load": [1], "probe": [1]}


def body(M=((1.0, 0.0), (0.0, 1.0)), K=((2.0, -1.0), (-1.0, 1.0)), ports=PORTS, **more):
    return port_model_from_matrices(np.array(M), np.array(K), ports, **more)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: body(M=((1.0, 0.1), (0.0, 1.0))), "M differs .* expected a Hermitian"),
        (lambda: body(K=np.full((2, 2), np.nan)), "K .* finite"),
        (lambda: body(M=np.eye(3)), "the same shape"),
        (lambda: body(C=-np.eye(2)), "C damps a motion by -1"),
        (lambda: body(M=-np.eye(2)), "M has the eigenvalue -1: expected a positive semidefinite"),
        (lambda: body(M=np.zeros((2, 2))), "M is zero"),
        (
            lambda: body(M=np.diag([1.0, 0.0]), K=np.diag([1.0, 0.0])),
            "a motion has neither mass nor stiffness",
        ),
        (lambda: replace(SIDE, shapes=np.nan * SIDE.shapes), "PortModel.shapes .* finite"),
        (lambda: replace(SIDE, omega=-SIDE.omega), "PortModel.omega from -1: expected no negative"),
        (lambda: replace(SIDE, damping=np.zeros(3)), r"PortModel.damping of shape \(3,\)"),
        (
            lambda: replace(SIDE, residual=np.zeros((2, 2))),
            "PortModel.shapes .* expected finite numbers of shape",
        ),
        (lambda: body(C=np.eye(3)), "C .* the same shape"),
        (lambda: body(C=np.array([[0, 1.0], [0, 0]])), "C damps a motion by -0.5"),
        (lambda: body(ports={}), "ports .* not empty"),
        (lambda: body(ports=[0]), "ports of type list"),
        (lambda: body(ports=PORTS | {"load": [0.5]}), r"ports\['load'\]: expected whole"),
        (lambda: body(ports=PORTS | {"load": [[np.nan, 0.0]]}), r"ports\['load'\]"),
    ],
)
def test_bodies(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sides": SIDE}, "sides of type PortModel: expected a tuple"),
        ({"sides": ()}, "sides of type tuple"),
        ({"sides": (replace(SIDE, ports={"contacts": slice(0, 1)}),)}, "expected a port 'contact'"),
        (
            {"sides": (replace(SIDE, ports=SIDE.ports | {"probe": slice(0, 0)}),)},
            "port 'probe' is empty",
        ),
        ({"elements": replace(E, mu=-E.mu)}, "elements.mu from -1: expected 1 finite .* negative"),
        ({"elements": replace(E, kt=np.nan * E.kt)}, "elements.kt from nan"),
        ({"elements": replace(E, n0=np.ones(3))}, r"elements.n0 of shape \(3,\)"),
        ({"elements": Elements(1.0, 0.0, 0.5, 1.0, 1)}, "one number for each contact node"),
        ({"elements": replace(E, kn=E.kt)}, "expected normal dofs"),
        ({"elements": replace(E, tangents=3)}, "tangents"),
        ({"elements": Elements([], [], [], [], 1)}, "with 0 elements"),
        ({"excitation": np.ones(1)}, "expected a dict"),
        ({"excitation": {1: 1.0}}, r"shape \(1,\)"),
        ({"excitation": {"one": np.ones(1)}}, "harmonic one"),
        ({"excitation": {1.5: np.ones(1)}}, "harmonic 1.5"),
        ({"excitation": {1: np.array([np.inf])}}, "finite"),
        ({"damping": Damping(np.ones(7))}, r"shape \(7,\)"),
        ({"damper": SIDE}, "damper of type PortModel"),
        ({"damper": (block().side(1),)}, "damper: contact port of 12 dofs"),
        ({"damper": RigidBody(np.eye(1), np.ones((2, 1)))}, "damper.B"),
        (
            {"damper": RigidBody(-np.eye(1), np.ones((1, 1)))},
            "damper.mass: expected a symmetric positive definite",
        ),
    ],
)
def test_models(change, words):
    with pytest.raises(InputError, match=words):
        replace(MODEL, **change)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Damping(-0.1), "damping.ratio = -0.1"),
        (lambda: Damping(stiffness=np.nan), "damping.stiffness = nan"),
        (lambda: solve(MODEL, np.ones(2)), "omega"),
        (lambda: solve(MODEL, 1.0, 2.5), "H 2.5"),
        (lambda: solve(MODEL, 1.0, "3"), "H 3"),
        (lambda: solve(MODEL, 1.0, 7, 8), "samples: 8 a period"),
        (lambda: solve(MODEL, 1.0, 0), "H 0"),
        (lambda: solve(MODEL, 1.0, 3, 1), "samples: 1 a period are too few"),
        (lambda: solve(MODEL, 1.0, 3, 64.5), "samples 64.5: expected a whole number"),
        (lambda: solve(block(), 1.0, 3, 0), "samples 0: .* one tangent"),
        (lambda: solve(MODEL, np.nan), "omega nan"),
        (lambda: solve(MODEL, 1.0, start=np.zeros(3)), "start"),
        (lambda: solve(MODEL, 1.0, start=solve(block(), 0.9)), "start"),
        (lambda: next(sweep(MODEL, (2.0, 1.0))), "band"),
        (lambda: next(sweep(MODEL, (1.0, 1.0))), "band"),
        (lambda: next(sweep(MODEL, (np.nan, 1.0))), "band"),
        (lambda: Options(iterations=2.5), "iterations 2.5"),
        (lambda: vary(MODEL, "load", -1.0), "load -1.0: expected a finite factor"),
        (lambda: vary(MODEL, "mu", np.nan), "mu nan"),
        (lambda: vary(MODEL, "mass", 2.0), "with a damper"),
        (
            lambda: optimum(MODEL, (0.5, 1.5), (-0.1, 1.0), name="gap"),
            "gap: a prescribed normal load has no gap",
        ),
        (lambda: Options(tolerance=1.0), "tolerance"),
        (
            lambda: next(sweep(MODEL, (1.0, 2.0), options=Options(probe=1))),
            "probe 1: expected a number from 0 to 0",
        ),
        (lambda: find_peak(MODEL, 1.0, options=Options(probe=-1)), "probe -1"),
        (lambda: optimum(MODEL, (0.5, 1.5), (10.0, 1.0)), "bounds"),
        (lambda: optimum(MODEL, (1.5, 0.5), (0.1, 1.0)), "band"),
        (lambda: optimum(MODEL, (0.5, 1.5), (0.1, 1.0), name="lode"), "did you mean 'load'"),
    ],
)
def test_calls(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_plain_lists_will_do():
    plain = ReducedModel(
        (body(),), Elements([1.0], [0.0], [0.5], [1.0], 1), {1: [1.0]}, Damping(0.01)
    )
    assert solve(plain, 0.7, 3, 64).converged and plain.elements.kt.dtype == float
