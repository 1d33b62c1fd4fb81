"""A killed response goes on where it stopped, with the same numbers, and solves again what
changed.
"""

from itertools import islice

import numpy as np
from models import single_mass

from bladefem.hbm import response as response_module
from bladefem.hbm.checkpoint import response_with_checkpoints
from bladefem.hbm.response import response

OMEGAS = np.linspace(0.8, 1.4, 9)


def test_a_killed_response_goes_on(tmp_path, monkeypatch):
    model, whole = single_mass(), list(response(single_mass(), OMEGAS, 5, 128))
    list(islice(response_with_checkpoints(tmp_path, model, OMEGAS, 5, 128), 4))
    (tmp_path / "stages" / "point-000004.npz").write_bytes(b"half a file")
    solved = []
    plain = response_module.solve_along
    monkeypatch.setattr(
        response_module,
        "solve_along",
        lambda m, omegas, *a: solved.extend(omegas) or plain(m, omegas, *a),
    )
    again = list(response_with_checkpoints(tmp_path, model, OMEGAS, 5, 128))
    assert solved == list(OMEGAS[3:])
    for one, other in zip(again, whole, strict=True):
        assert (
            np.array_equal(one.probe, other.probe)
            and one.states == other.states
            and one.work == other.work
        )
    solved.clear()
    list(response_with_checkpoints(tmp_path, single_mass(limit=0.6), OMEGAS, 5, 128))
    assert solved == list(OMEGAS)


def test_memory_does_not_grow_along_a_curve():
    """Of 400 points nothing stays but the last two: a point kept would be 2 kB, 0.8 MB
    altogether.
    """
    import gc
    import tracemalloc

    model = single_mass()
    points = response(model, np.linspace(0.5, 1.8, 420), 7, 128)
    list(islice(points, 20))
    gc.collect()
    tracemalloc.start()
    for _ in points:
        pass
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert grown < 30_000
