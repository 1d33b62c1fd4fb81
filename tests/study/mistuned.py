"""The shipped mistuned wheel on a mesh that a test can afford."""

from pathlib import Path

MISTUNED = Path(__file__).parents[2] / "scenes" / "mistuned.toml"
COARSE_MISTUNED = (
    "mesh.size=16 mm",
    "mesh.seat_elements=2",
    "study.loads=80 N",
    "contact.points=2",
    "model.modes=6",
    "model.static=uncoupled",
)
