"""The command that fits the contact of a scene to measured responses."""

from __future__ import annotations

import argparse

from ..errors import InputError
from ..scene.units import parse
from ..util.communicator import Communicator
from . import tables
from .commands import prepared, tell


def add_fit(sub: argparse.ArgumentParser) -> None:
    """The arguments of ``fit`` beyond those of a scene."""
    sub.add_argument(
        "--measured",
        metavar="CSV",
        required=True,
        help="readings: columns 'frequency [Hz]' and 'amplitude [um]' at the scene's probe, and "
        "where they differ 'load [N]' of a seat and 'force [N]'",
    )
    sub.add_argument(
        "--parameters",
        metavar="NAMES",
        default="",
        help="of mu, kt, kn, stiffness (both of these), load; all of the scene's when left out",
    )
    sub.add_argument(
        "--error", default="5 %", help="to which an amplitude was measured (%(default)s)"
    )


def fit(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Friction coefficient, contact stiffness and normal load with intervals."""
    error = parse(options.error, "1", "--error")
    if not 0 < error < 1:
        raise InputError(f"--error {options.error}: expected a share above 0 and below 100 %")
    names = [name.strip() for name in options.parameters.split(",") if name.strip()]
    scene, folder, bars = prepared(options, comm, responds=True)
    from ..io.stage_cache import on_root
    from ..report.measured import fit_sentences, terminal_table, write_fit
    from ..report.tables import readable_texts
    from ..study.measured_responses import check_parameters, fit_scene, read_readings

    check_parameters(names, scene)
    readings = on_root(comm, lambda: read_readings(options.measured, scene))
    found = fit_scene(scene, readings, names, error, folder, comm, bars)
    files = on_root(comm, lambda: write_fit(found, folder))
    tell(
        options,
        comm,
        lambda: "\n".join(
            [
                tables.frame_table(readable_texts(terminal_table(found))),
                "",
                *fit_sentences(found),
                f"written: {', '.join(map(str, files))}",
            ]
        ),
    )
