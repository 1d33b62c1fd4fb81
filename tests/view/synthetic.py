"""Made-up results with known answers, in the shapes that the solvers hand over."""

import numpy as np
import pandas as pd

from bladefem.data import Patch, PressureMap

LOADS = (0.0, 20.0, 50.0, 100.0, 200.0, 400.0, 800.0, 1600.0, np.inf)


def seats(n=11, m=7):
    """Two inclined flat faces of 40 x 6 mm; a parabola that opens at one end, 120 N on each."""
    return [seat("this", 1.0, n, m), seat("next", -1.0, n, m)]


def seat(name, side, n, m):
    z, s = np.meshgrid(np.linspace(-0.02, 0.02, n), np.linspace(0, 0.006, m), indexing="ij")
    normal = np.array([-np.sin(0.7), side * np.cos(0.7), 0.0])
    slope = np.array([np.cos(0.7), side * np.sin(0.7), 0.0])
    points = (
        0.25 * np.array([1.0, 0, 0])
        + s.reshape(-1, 1) * slope
        + z.reshape(-1, 1) * np.array([0.0, 0, 1])
    )
    number = np.arange(n * m).reshape(n, m)
    faces = np.stack(
        [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1
    ).reshape(-1, 4)
    area = np.outer(hat(n) * 0.04 / (n - 1), hat(m) * 0.006 / (m - 1)).ravel()
    pressure = (
        np.maximum(0.0, 1 - ((z - 0.004) / 0.02) ** 2).ravel() * (1 + 40 * s.ravel()) * (side + 2)
    )
    pressure *= 120.0 / (pressure @ area)
    frame = np.tile(np.stack([normal, np.array([0.0, 0, 1]), slope]), (n * m, 1, 1))
    patch = Patch(name, points, area, frame, faces, np.arange(n * m))
    return PressureMap(patch, pressure * area, np.where(pressure > 0, 0.0, 1e-7), 1e-12)


def hat(n):
    """Trapezoid weights."""
    weight = np.ones(n)
    weight[[0, -1]] = 0.5
    return weight


def line_seats(n=15):
    """A plane face of 12 mm along y with a parabola."""
    y = np.linspace(0, 0.012, n)
    points = np.stack([np.full(n, 0.045), y, np.zeros(n)], 1)
    area = hat(n) * 0.012 / (n - 1) * 0.03
    pressure = np.maximum(0, 1 - ((y - 0.006) / 0.005) ** 2) * 2e6
    frame = np.tile(np.array([[-1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]), (n, 1, 1))
    faces = np.stack([np.arange(n - 1), np.arange(1, n)], 1)
    patch = Patch("this", points, area, frame, faces, np.arange(n))
    return [PressureMap(patch, pressure * area, np.zeros(n), 0.0)]


def state(load):
    """Resonance frequency and damping ratio that move from free to stuck with the load."""
    stuck = 1.0 if load == np.inf else load / (load + 200.0)
    return 812.0 + 160.0 * stuck, 0.001 + 0.05 * stuck * (1 - stuck)


def points(count=161):
    """Forced responses of an oscillator; three points of the load 400 N have not converged."""
    frames = []
    for load in LOADS:
        resonance, damping = state(load)
        frequency = np.sort(np.append(np.linspace(760, 1040, count), resonance))
        r = frequency / resonance
        amplitude = 1e-6 / np.hypot(1 - r**2, 2 * damping * r)
        converged = np.ones(len(r), bool)
        if load == 400.0:
            converged[60:63] = False
            amplitude[62] = np.nan
        frames.append(
            pd.DataFrame(
                {
                    "load": load,
                    "frequency": frequency,
                    "amplitude": amplitude,
                    "converged": converged,
                    "method": np.where(np.arange(len(r)) % 40 == 7, "homotopy", "newton"),
                    "residual": np.where(converged, 1e-12, 1e-3),
                    "iterations": 6,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def summary():
    """One row a load."""
    rows = []
    for load in LOADS:
        resonance, damping = state(load)
        rows.append(
            {
                "load": load,
                "peak_frequency": resonance,
                "peak_amplitude": 1e-6 / (2 * damping),
                "dissipated_energy": 1e-3 * damping,
                "friction_damping": damping - 0.001,
                "unconverged": 3 if load == 400.0 else 0,
            }
        )
    return pd.DataFrame(rows)


def loops():
    """Stick and slip loops of a Jenkins element, k 1e6 N/m, limit 3 N; area 4 F (A - F / k)."""
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    result = {}
    for amplitude in (2e-6, 5e-6, 1e-5):
        x = amplitude * np.cos(t)
        force, history = 0.0, []
        for _ in range(2):
            history = []
            for now, before in zip(x, np.roll(x, 1), strict=True):
                force = np.clip(force + 1e6 * (now - before), -3.0, 3.0)
                history.append(force)
        result[f"amplitude {1e6 * amplitude:.0f} µm"] = (x, np.array(history))
    return result


def accuracy():
    """Settings of one method: error falls as time rises, with some dominated ones and a failure."""
    h = np.array([1, 3, 5, 7, 9, 15])
    table = pd.DataFrame(
        {
            "name": [f"H {k}" for k in h],
            "time": 0.02 * h**1.5,
            "error": 0.05 * h**-2.5,
            "chosen": h == 3,
            "converged": True,
            "family": "adaptive",
        }
    )
    worse = table.assign(
        time=3 * table["time"], error=2 * table["error"], chosen=False, family="fixed"
    )
    worse.loc[2, "converged"] = False
    return pd.concat([table, worse], ignore_index=True)


def wheel_frequencies(sectors=24):
    """Two blade families that rise with the nodal diameter, crossing one disc family."""
    n = np.arange(sectors // 2 + 1)
    families = {
        "first flap": 800 - 200 / (1 + n),
        "disc": 300 + 60 * n**1.3,
        "first torsion": 2100 - 150 / (1 + n),
    }
    table = pd.concat(
        [
            pd.DataFrame({"nodal_diameter": n, "family": name, "frequency": f})
            for name, f in families.items()
        ]
    )
    table = table.sort_values(["nodal_diameter", "frequency"])
    return table.assign(mode=table.groupby("nodal_diameter").cumcount() + 1).reset_index(drop=True)


def campbell():
    """Three lines of one nodal diameter, f^2 = f0^2 + B (speed / 2 pi)^2."""
    speed = np.linspace(0, 1200, 7)
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "speed": speed,
                    "mode": i + 1,
                    "family": name,
                    "frequency": np.sqrt(f**2 + b * (speed / 2 / np.pi) ** 2),
                }
            )
            for i, (name, f, b) in enumerate(
                [("first flap", 600, 2.0), ("first edge", 1150, 1.1), ("first torsion", 1500, 0.6)]
            )
        ],
        ignore_index=True,
    )
