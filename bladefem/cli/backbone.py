"""The command of nonlinear modes: frequency and damping against amplitude for each load."""

from __future__ import annotations

import argparse

from ..util.communicator import Communicator
from . import tables
from .commands import prepared, tell


def backbone(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Nonlinear modes on top of the run's responses, and the design map."""
    scene, folder, bars = prepared(options, comm, responds=True)
    from ..io.stage_cache import on_root
    from ..report.backbone import backbone_messages, prediction_table, write_backbones
    from ..report.tables import readable_texts
    from ..study.backbone import run_backbones
    from ..study.pipeline import pipeline

    run = pipeline.run(scene, folder, comm=comm, progress=bars)
    found, remarks = run_backbones(run, comm, bars)
    said = backbone_messages(run, found, remarks)
    files = on_root(comm, lambda: write_backbones(run, found, said))
    tell(
        options,
        comm,
        lambda: "\n".join(
            [
                tables.frame_table(readable_texts(prediction_table(found, run))),
                "",
                *(f"{text}\n" for text in tables.message_lists(said, "report_backbone.html")),
                f"written: {', '.join(map(str, files))}",
            ]
        ),
    )
