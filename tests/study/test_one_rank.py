"""What is solved by one rank is the same on all, and later stages find its factorisations again."""

from types import SimpleNamespace

import numpy as np
import pytest

from bladefem import load_scene
from bladefem.errors import NotSolvedError
from bladefem.fem.compat import MPI
from bladefem.reduction.other_diameters import spanned_models
from bladefem.study.pipeline import pipeline, response_stage
from bladefem.study.pipeline.bodies import Bodies, on_one_rank
from bladefem.study.pipeline.damper_contact import contact_patches
from bladefem.study.pipeline.normal_modes import KEPT_MODES, find_modes
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.stage_runner import StageClock, StageOfOneRank, StageRunner

pytestmark = pytest.mark.mpi
COARSE = ["mesh.size=14 mm", "mesh.scale=1.5", "mesh.seat_elements=2", "aerofoil.fillet=0 mm"]


def test_a_sector_is_reduced_with_the_modes_that_each_rank_has():
    scene = load_scene("scenes/wedge.toml", COARSE)
    mesh = build_mesh(scene, MPI.COMM_WORLD)
    patches = contact_patches(mesh)
    models = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        bodies = Bodies(scene, mesh, comm)
        modes = find_modes(bodies, [0, 9, 18], 4, reduced=6)
        kept = bodies.alone.kept.get(KEPT_MODES)
        if comm.size == 1:
            assert sorted(kept.pairs) == [0, 9, 18]
        reduced = reduce_sector(bodies, patches, [0, 9, 18], 6, spanned=True)
        models.append((modes, reduced))
    (ranks, joined), (alone, single) = models
    for a, b in zip(ranks, alone, strict=True):
        np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-10)
    for n in (0, 9, 18):
        np.testing.assert_allclose(joined.sector[n].omega, single.sector[n].omega, rtol=1e-10)
        left, right = joined.sector[n].residual, single.sector[n].residual
        # modes are known to a direction, the flexibility that they leave to its square
        assert abs(left - right).max() < 1e-9 * abs(right).max()
    assert joined.mass == single.mass
    # also what they tell of the diameters left out
    left_out = [
        spanned_models(some.span, {9: some.sector[9]}, some.sectors, 6)[4]
        for some in (joined, single)
    ]
    np.testing.assert_allclose(left_out[0].omega, left_out[1].omega, rtol=1e-8)


def test_one_rank_computes_and_all_have_it():
    scene = load_scene("scenes/plane.toml", ["mesh.size=8 mm"])
    bodies = Bodies(scene, build_mesh(scene, MPI.COMM_WORLD), MPI.COMM_WORLD)
    ran = []
    found = on_one_rank(bodies, lambda some: ran.append(1) or some.still_blade.comm.size)
    assert found == 1
    assert MPI.COMM_WORLD.allreduce(len(ran)) == 1


def test_ranks_that_share_a_blade_give_the_factors_of_its_rest_back():
    """One rank seats the damper with its own; the stiffness under rotation is that of one rank."""
    scene = load_scene("scenes/wedge.toml", COARSE)
    mesh = build_mesh(scene, MPI.COMM_WORLD)
    assert scene.operation.speed > 0
    norms = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        bodies = Bodies(scene, mesh, comm)
        norms.append(bodies.blade.K.norm())
        assert ("still" in vars(bodies)) == (comm.size == 1)
    assert norms[0] == pytest.approx(norms[1], rel=1e-12)


def test_stages_of_one_rank_are_computed_side_by_side():
    """Each by another rank and once; all ranks find each where its turn comes."""
    scene = load_scene("scenes/wedge.toml", COARSE)
    bodies = Bodies(scene, build_mesh(scene, MPI.COMM_WORLD), MPI.COMM_WORLD)
    keep = StageRunner(None, MPI.COMM_WORLD, StageClock({}, []))
    stages = [
        StageOfOneRank(name, name, lambda some: (MPI.COMM_WORLD.rank, some.comm.size))
        for name in ("contact", "mode_errors")
    ]
    keep.compute_ahead(stages, bodies)
    found = [keep.of_one_rank(stage, bodies) for stage in stages]
    assert found == [(0, 1), (min(1, MPI.COMM_WORLD.size - 1), 1)]
    # asked again they are computed again, by rank 0
    assert keep.of_one_rank(stages[1], bodies)[0] == 0


def test_influences_are_found_beside_an_added_load():
    """By one rank and once; all ranks find them where their turn comes."""
    comm = MPI.COMM_WORLD
    keep = StageRunner(None, comm, StageClock({}, []))
    stage = response_stage._InfluenceStage("key", lambda one: [comm.rank, one])
    beside = [stage]
    added = response_stage._added_curves(
        SimpleNamespace(keep=keep), lambda load: 2 * load, beside, [3.0, 4.0]
    )
    assert added == [6.0, 8.0] and beside == []
    rank, given = keep(response_stage.INFLUENCES, "key", lambda: pytest.fail("computed again"))
    assert 0 <= rank < comm.size and given is None
    # further loads have nothing beside them
    again = response_stage._added_curves(SimpleNamespace(keep=keep), abs, beside, [5.0])
    assert again == [5.0] and keep.ahead == {}


def test_influences_that_are_not_found_beside_a_load_are_left_to_their_stage():
    def refuse(comm):
        raise NotSolvedError("no resonance")

    keep = StageRunner(None, MPI.COMM_WORLD, StageClock({}, []))
    beside = [response_stage._InfluenceStage("key", refuse)]
    assert response_stage._added_curves(SimpleNamespace(keep=keep), abs, beside, [5.0]) == [5.0]
    assert keep.ahead == {}


def test_one_rank_solves_the_preload_and_another_a_stage_meanwhile():
    """No other rank factorises the blade at rest, and all have the state that each would find."""
    scene = load_scene("scenes/wedge.toml", COARSE)
    mesh = build_mesh(scene, MPI.COMM_WORLD)
    bodies = Bodies(scene, mesh, MPI.COMM_WORLD)
    keep = StageRunner(None, MPI.COMM_WORLD, StageClock({}, []))
    stage = StageOfOneRank("clamped", "clamped", lambda some: (MPI.COMM_WORLD.rank, some.comm.size))
    keep.compute_beside_state(stage, bodies)
    several = MPI.COMM_WORLD.size > 1
    assert ("still" in vars(bodies.alone)) == (several and MPI.COMM_WORLD.rank == 0)
    assert keep.of_one_rank(stage, bodies) == (int(several), 1)
    expected = Bodies(scene, mesh, MPI.COMM_SELF)
    assert bodies.alone.state.speed == expected.state.speed
    scale = abs(expected.state.displacement).max()
    for name, size in (("state", scale), ("swell", abs(expected.swell).max())):
        one, other = (getattr(some, name) for some in (bodies.alone, expected))
        one, other = (getattr(x, "displacement", x) for x in (one, other))
        np.testing.assert_allclose(one, other, atol=1e-12 * size)
    assert bodies.alone.blade.K.norm() == pytest.approx(expected.blade.K.norm(), rel=1e-12)
    assert ("still" in vars(bodies.alone)) == (not several or MPI.COMM_WORLD.rank == 0)


def test_contact_and_mesh_error_do_not_depend_on_the_rank_that_found_them():
    given = ["model.modes=4", "model.harmonics=1", "model.samples=64", "model.damper=rigid"]
    scene = load_scene("scenes/wedge.toml", [*COARSE, *given, "contact.points=4"])
    ranks, alone = (
        pipeline.run(scene, None, until="reduction", comm=comm)
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    np.testing.assert_allclose(
        ranks.mode_errors.energies, alone.mode_errors.energies, rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(
        ranks.contact.problem.flexibility, alone.contact.problem.flexibility, rtol=1e-9
    )
    np.testing.assert_allclose(ranks.clamped.frequencies, alone.clamped.frequencies, rtol=1e-10)
    assert ranks.strength.steady == pytest.approx(alone.strength.steady, rel=1e-9)
