"""From a scene to the whole wheel: the same model as the tuned sector's, and bad input refused
before long work.
"""

from pathlib import Path

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.hbm.solve import solve
from bladefem.scene.toml import load_scene
from bladefem.study.adaptive.family import family_member
from bladefem.study.adaptive.settings import first_settings
from bladefem.study.mistuning.stage import check_mistuning
from bladefem.study.mistuning.whole_wheel import reduce_wheel, whole_wheel
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.case_models import family_of_case, load_cases
from bladefem.study.pipeline.stages import Bodies
from bladefem.wheel.model import frequency_pattern
from bladefem.wheel.solve import free_wheel, solve_wheel

SCENE = Path(__file__).parents[2] / "scenes" / "mistuned.toml"
COARSE = [
    "mesh.size=16 mm",
    "mesh.seat_elements=2",
    "study.loads=80 N",
    "contact.points=2",
    "model.modes=6",
    "model.static=uncoupled",
]


@pytest.fixture(scope="module")
def reduced():
    scene = load_scene(SCENE, COARSE)
    run = pipeline.run(scene, None, until="reduction")
    patches = list(run.contact.problem.patches)
    sector = reduce_wheel(Bodies(scene, run.mesh), patches, 6, run.clamped, 3)
    (case,) = load_cases(scene, run.mesh, run.contact)
    settings = first_settings(scene)
    return scene, run, patches, sector, case, settings


def test_whole_wheel_is_the_tuned_sector(reduced):
    scene, run, patches, sector, case, settings = reduced
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    family = family_of_case(scene, run.mesh, run.reduced, patches, case)
    model = family_member(family, settings).model
    omega = 0.99 * model.side(1).omega[0]
    one = solve(model, omega, 1, 72)
    found = solve_wheel(wheel, omega, 1, 72)
    assert one.converged and found.converged
    turn = np.exp(2j * np.pi * 9 / 36 * np.arange(36))
    np.testing.assert_allclose(
        found.probe[:, 1, 0], one.probe[1, 0] * turn, atol=1e-7 * abs(one.probe).max()
    )


def test_stiffer_blades_raise_the_resonance_by_the_aerofoils_share(reduced):
    """1 % on all blades: the wheel's resonance rises, by less than the blades' own."""
    scene, run, patches, sector, case, settings = reduced
    wheel = whole_wheel(scene, run.mesh, sector, patches, case, settings)
    own = wheel.sectors[9].omega[0]
    pattern = frequency_pattern(sector.families, np.full(36, 0.01))
    grid = own * np.linspace(0.999, 1.011, 241)
    size = [abs(free_wheel(wheel, w, 1, pattern)[:, 1, 0]) for w in grid]
    # all blades alike: the tuned wave in all of them
    np.testing.assert_allclose(np.ptp(size, axis=1), 0, atol=1e-9 * np.max(size))
    rise = grid[int(np.argmax(np.max(size, axis=1)))] / own - 1
    assert 0.002 < rise < 0.0101


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["mistuning.pattern=nowhere.csv"], "pattern file .*nowhere.csv: not found"),
        (["disc.sectors=35"], "36 blades, expected 35"),
        (["mistuning.orders=10: 0.3 N"], "expected a multiple of excitation.engine_order = 9"),
        (["mistuning.orders=half: 0.3 N"], "expected a whole order and a force"),
    ],
)
def test_bad_input_is_refused_before_long_work(overrides, message):
    with pytest.raises(InputError, match=message):
        check_mistuning(load_scene(SCENE, overrides))
