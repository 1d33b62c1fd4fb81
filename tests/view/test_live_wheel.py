"""All blades of a wheel in motion on a page: tips move as the probes do, feet and rim stay."""

import base64

import numpy as np

from bladefem.view.live_wheel import ROWS, live_wheel


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def displacement(mode, phase, count):
    """(n,) along the axis, as page.js moves the nodes."""
    z = np.zeros(count)
    for part in mode["harmonics"]:
        real = unpacked(part["real"], np.int16).reshape(-1, 3)
        imaginary = 0 * real
        if "imaginary" in part:
            imaginary = unpacked(part["imaginary"], np.int16).reshape(-1, 3)
        turn = part["order"] * phase
        moved = part["scale"] * (np.cos(turn) * real - np.sin(turn) * imaginary.astype(float))
        assert not moved[:, :2].any()
        z += moved[:, 2]
    return z


def test_tips_move_as_the_probes_do():
    rng = np.random.default_rng(0)
    probe = rng.normal(size=(12, 3)) + 1j * rng.normal(size=(12, 3))
    probe *= 1e-5 * np.array([1.0, 0.0, 0.2])
    spec = live_wheel(probe, "80 N")
    points = unpacked(spec["points"], np.float32).reshape(-1, 3)
    triangles = unpacked(spec["triangles"], np.uint32)
    assert triangles.max() == len(points) - 1 and len(set(triangles)) == len(points)
    (mode,) = spec["modes"]
    # the harmonic without motion is left out
    assert [part["order"] for part in mode["harmonics"]] == [1, 3]
    assert np.isclose(mode["amplitude"], 1e6 * np.linalg.norm(probe, axis=1).max())
    for phase in (0.0, 0.7, 3.0):
        z = displacement(mode, phase, len(points))[: 12 * 2 * ROWS].reshape(12, ROWS, 2)
        expected = (np.exp(1j * np.arange(1, 4) * phase) * probe).real.sum(axis=1)
        tips = z[:, -1].mean(axis=1)
        scale = tips @ expected / (expected @ expected)
        np.testing.assert_allclose(tips, scale * expected, atol=1e-3 * abs(tips).max())
        assert abs(z[:, 0]).max() < 1e-6
    # it begins where the highest blade is farthest out
    worst = int(np.argmax(np.linalg.norm(probe, axis=1)))
    heights = [
        (np.exp(1j * np.arange(1, 4) * phase) * probe[worst]).real.sum()
        for phase in np.radians([mode["start"], mode["start"] + 40, mode["start"] - 40])
    ]
    assert heights[0] == max(heights)
