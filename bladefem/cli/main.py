"""The command ``bladefem``: arguments, exit codes, and what happens when something goes wrong.

Exit codes: 0 done, 1 not solved, 2 bad input, 130 interrupted, 143 ended by SIGTERM.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from io import TextIOWrapper

from ..util.communicator import Communicator
from . import backbone, commands, ranks, scatter, study
from .fit import add_fit, fit
from .look import add_look, look

_EXAMPLES = """examples:
  bladefem check scenes/wedge.toml                          every value, defaults marked
  bladefem mesh scenes/wedge.toml --view mesh.png           mesh and picture in seconds
  bladefem modes scenes/wedge.toml --set operation.speed="9000 rpm"
  bladefem run scenes/wedge.toml -o runs/wedge              everything, with report and figures
  bladefem run runs/wedge --set contact.mu=0.2              again: finished stages are kept
  bladefem modes scenes/wedge.toml -- -eps_monitor          options of PETSc and SLEPc

exit codes: 0 done, 1 not solved, 2 bad input, 130 interrupted, 143 ended by SIGTERM"""

# command: (what it does, example, function)
_COMMANDS = {
    "check": (
        "print the resolved scene, defaults marked, and what is wrong with it",
        "bladefem check scenes/wedge.toml --set aerofoil.twist='25 deg'",
        commands.check,
    ),
    "mesh": (
        "draw and mesh the geometry into mesh.vtu and named_mesh.msh, print the quality table",
        "bladefem mesh scenes/wedge.toml --view mesh.png",
        commands.mesh,
    ),
    "modes": (
        "natural frequencies and mode shapes, for each nodal diameter of a wheel, with tables and "
        "pictures",
        "bladefem modes scenes/wedge.toml --set model.nodal_diameters=0,1,6\n"
        "  bladefem modes scenes/wedge.toml --campbell '0, 2000, ..., 12000 rpm'\n"
        "  bladefem modes scenes/wedge.toml --forced 'pressure_side=500 Pa' --damping "
        "'structural=0.2 %'\n"
        "  bladefem modes scenes/plane.toml --converge '6, 4, 2.8 mm'\n"
        "  bladefem modes scenes/wedge.toml -o runs/b --set aerofoil.twist='25 deg' --compare "
        "runs/wedge",
        commands.modes,
    ),
    "contact": (
        "seat the damper: pressure on each face",
        "bladefem contact scenes/wedge.toml",
        commands.contact,
    ),
    "reduce": (
        "reduce blade and damper to their contact points, ready for responses on many ranks",
        "bladefem reduce scenes/wedge.toml",
        commands.reduce,
    ),
    "response": (
        "forced response with friction for each load",
        "bladefem response scenes/wedge.toml --set study.loads='20, 50, 100 N'",
        commands.response,
    ),
    "study": (
        "runs for several values of one or two fields, or for scattered ones, side by side",
        "bladefem study scenes/wedge.toml --vary damper.angle='30, 40, 50 deg'\n"
        "  bladefem study scenes/wedge.toml --vary damper.angle='50, 60 deg' --vary "
        "contact.mu='0.2, 0.3'\n"
        "  bladefem study scenes/wedge.toml --scatter contact.mu='0.2, 0.4' --samples 16",
        study.study,
    ),
    "scatter": (
        "statistics of mistuned wheels: amplification of the highest blade for each load",
        "bladefem scatter scenes/mistuned.toml --set mistuning.wheels=100",
        scatter.scatter,
    ),
    "backbone": (
        "nonlinear modes: frequency and friction damping against amplitude for each load, and the "
        "resonance that they predict",
        "bladefem backbone scenes/wedge.toml",
        backbone.backbone,
    ),
    "fit": (
        "contact from measured responses: friction, stiffness and normal load with intervals",
        "bladefem fit scenes/wedge.toml --measured readings.csv --parameters mu,stiffness",
        fit,
    ),
    "chart": (
        "chart of CPU time against error, for methods, models and the automatic choice",
        "bladefem chart scenes/plane.toml --budget 60",
        commands.chart,
    ),
    "report": (
        "figures, tables and report of a run folder; what is missing is computed",
        "bladefem report runs/wedge",
        commands.report,
    ),
    "run": (
        "everything, from mesh to report",
        "bladefem run scenes/wedge.toml -o runs/wedge",
        commands.report,
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; messages go to the error stream of rank 0."""
    # more BLAS threads only get in each other's way
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    _replace_unknown_letters()
    words = list(sys.argv[1:] if arguments is None else arguments)
    # what follows -- is for PETSc, and part of the scene: stored stages know of it
    cut = words.index("--") if "--" in words else len(words)
    options = parser().parse_args(words[:cut])
    if words[cut + 1 :]:
        if not hasattr(options, "overrides"):
            parser().error("options of PETSc (after --) need a command with a scene")
        options.overrides.append(f"solver.petsc={' '.join(words[cut + 1 :])}")

    def command(comm: Communicator | None) -> None:
        # run folders, kept for this command; they see how it ends
        with ExitStack() as options.held:
            options.function(options, comm)
        if comm is None or comm.rank == 0:
            _warn_of_unused_options()

    return ranks.exit_code_of(command, options)


def _warn_of_unused_options() -> None:
    """Name options that PETSc got and that nothing has asked for: misspelt ones, or those of parts
    that the command does not use.
    """
    # only where it has been loaded: most commands do not need it
    compat = sys.modules.get("bladefem.fem.compat")
    names = [] if compat is None else compat.unused_options()
    if names:
        print(
            f"bladefem: warning: solver.petsc: nothing asked for -{', -'.join(names)}, which had "
            "no effect; expected options of the parts of PETSc and SLEPc that this command uses, "
            "such as -eps_ncv or -eps_monitor",
            file=sys.stderr,
            flush=True,
        )


def _replace_unknown_letters() -> None:
    """Print "?" for letters that the terminal's encoding does not have, as ± and ∞ in Latin 1 or
    umlauts in ASCII; the summary of a run would end in a traceback.
    """
    # Python's own choice in the locales C and POSIX is "surrogateescape", which fails as "strict"
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
        sys.stdout.reconfigure(errors="replace")


def parser() -> argparse.ArgumentParser:
    """All commands with their arguments."""
    top = argparse.ArgumentParser(
        "bladefem",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Friction-damped turbine blades, from geometry to design chart.",
    )
    subs = top.add_subparsers(dest="command", required=True, metavar="command")
    for name, (what, example, function) in _COMMANDS.items():
        _scene_arguments(name, _add_command(subs, name, what, example, function))
    subs.choices["mesh"].add_argument(
        "--view", metavar="PNG", help="also draw the mesh into this file"
    )
    for name in ("report", "run", "modes"):
        subs.choices[name].add_argument(
            "--pdf", action="store_true", help="also print the report as PDF, by Chromium"
        )
    _modes_arguments(subs.choices["modes"])
    add_fit(subs.choices["fit"])
    study.add_study(subs.choices["study"])
    _chart_arguments(subs.choices["chart"])
    info = _add_command(
        subs,
        "info",
        "versions and threads of what bladefem runs on",
        "bladefem info",
        commands.info,
    )
    info.set_defaults(scene=None)
    add_look(
        _add_command(
            subs,
            "look",
            "what a mesh file holds: bodies, sets, numbered faces, a scene to start from",
            "bladefem look sector.inp --view faces.png --scene sector.toml",
            look,
        )
    )
    return top


def _scene_arguments(name: str, sub: argparse.ArgumentParser) -> None:
    """What every command takes that reads a scene."""
    sub.add_argument(
        "scene",
        nargs="?" if name == "chart" else None,
        help="scene file (TOML), or the folder of an earlier run",
    )
    sub.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="overrides",
        help="another value for one field, such as aerofoil.twist='25 deg'; may be repeated; "
        "'bladefem check SCENE' lists the fields",
    )
    if name == "check":
        return
    sub.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        help="run folder (default: runs/<name of the scene>)",
    )
    sub.add_argument("-q", "--quiet", action="store_true", help="no progress and no summary")


def _chart_arguments(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--budget",
        type=float,
        default=120.0,
        metavar="SECONDS",
        help="CPU time for the variants (%(default)g); what would exceed it is left out and named",
    )
    sub.add_argument(
        "--reference", action="store_true", help="the built-in reference blade instead"
    )
    sub.add_argument(
        "--mesh",
        metavar="SIZES",
        nargs="?",
        const="",
        help="also compare meshes of "
        "first and second order with these element sizes, such as '10, 7, 5 mm'",
    )


def _modes_arguments(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--campbell",
        metavar="SPEEDS",
        help="Campbell and interference diagrams, at speeds such as "
        "'0, 2000, 4000 rpm' or '0, 1000, ..., 12000 rpm'",
    )
    sub.add_argument(
        "--converge",
        metavar="SIZES",
        nargs="?",
        const="",
        help="refine the mesh: frequencies at three "
        "or more element sizes such as '6, 4, 2.8 mm' (chosen when left out), estimated limit and "
        "order; a mesh from a file is halved instead",
    )
    sub.add_argument(
        "--compare", metavar="FOLDER", help="MAC of the mode shapes against those of an earlier run"
    )
    sub.add_argument(
        "--forced",
        metavar="LOADS",
        nargs="?",
        const="",
        help="linear response to the engine order, "
        "of the scene's excitation or of loads such as 'excitation, pressure_side=500 Pa'",
    )
    sub.add_argument(
        "--damping",
        metavar="KINDS",
        help="for --forced instead of the scene's: 'ratio=0.1 %%', "
        "'structural=0.2 %%', 'mass=20 1/s, stiffness=1e-7 s'",
    )
    sub.add_argument(
        "--direct", action="store_true", help="solve every nodal diameter from scratch"
    )
    sub.add_argument(
        "--pictures",
        metavar="N",
        type=int,
        default=1,
        help="first modes that are drawn large (%(default)s), in addition to that of "
        "excitation.mode; 0: tables only",
    )


def _add_command(
    subs: argparse._SubParsersAction[argparse.ArgumentParser],
    name: str,
    what: str,
    example: str,
    function: object,
) -> argparse.ArgumentParser:
    sub = subs.add_parser(
        name,
        help=what,
        description=f"{what[0].upper()}{what[1:]}.",
        epilog=f"{'examples' if chr(10) in example else 'example'}:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    sub.set_defaults(function=function, output=None, quiet=False)
    return sub


if __name__ == "__main__":
    sys.exit(main())
