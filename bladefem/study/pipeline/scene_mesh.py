"""The mesh of a scene, the same on every rank."""

from __future__ import annotations

from geometry.mesh import Mesh

from ...io.stage_cache import on_root
from ...scene.tables import Scene
from ...util.communicator import Communicator


def build_mesh(scene: Scene, comm: Communicator | None = None) -> Mesh:
    """The scene's mesh, drawn on rank 0 and the same on every rank.

    Raises:
        InputError: a parameter has to change; the message names it.

    >>> import bladefem
    >>> mesh = bladefem.build_mesh(bladefem.load_scene("scenes/plane.toml", ["mesh.size=8 mm"]))
    >>> mesh.cell_type, sorted(mesh.bodies)
    ('triangle6', ['blade', 'damper'])
    """

    def draw() -> Mesh:
        from geometry.isolated_process import build_isolated

        return build_isolated(scene)

    return on_root(comm, draw)
