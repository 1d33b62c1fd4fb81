"""Tables, picture, sentences and page of the nonlinear modes of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..io.run_folder import take_folder
from ..scene.units import newtons
from ..study.backbone import Backbone
from ..study.pipeline.run_records import SolvedRun, folder_of
from ..util.message import warning
from ..util.percent import percent
from ..view.backbone import draw_design_map
from .best_load import error_words
from .headlines import Headline
from .tables import write_tables
from .write import Page, write_report


def prediction_table(found: Sequence[Backbone], run: SolvedRun | None = None) -> pd.DataFrame:
    """One row a load: the resonance by the mode alone next to the balance's.

    Args:
        run: adds the estimated error of the balance, which judges the mode.
    """
    return pd.DataFrame(
        [
            {
                "load": one.load,
                **({} if one.mass is None else {"mass": one.mass}),
                "mode_frequency": one.predicted[1],
                "mode_amplitude": one.predicted[0],
                "balance_frequency": one.balance[1],
                "balance_amplitude": one.balance[0],
                "off": one.error,
                "detached_amplitude": max((a for a, _ in one.resonances[1:]), default=np.nan),
                **({} if run is None else {"balance_error": balance_error(run, one)["error"]}),
                "most_friction": one.friction[one.converged].max(initial=0.0),
                "unconverged": int((~one.converged).sum()),
            }
            for one in found
        ]
    )


def backbone_table(found: Sequence[Backbone]) -> pd.DataFrame:
    """One row an amplitude and load."""
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "load": one.load,
                    **({} if one.mass is None else {"mass": one.mass}),
                    "amplitude": one.amplitude,
                    "frequency": one.frequency,
                    "friction_damping": one.friction,
                    "own_damping": one.own,
                    "drive": one.drive,
                    "fold": one.fold,
                    "converged": one.converged,
                }
            )
            for one in found
        ],
        ignore_index=True,
    )


def backbone_sentences(found: Sequence[Backbone]) -> list[str]:
    """What the modes tell, and how well they predict."""
    most = max(found, key=lambda one: one.friction[one.converged].max(initial=0.0))
    i = int(np.argmax(np.where(most.converged, most.friction, -np.inf)))
    sentences = [
        f"friction damps at most {100 * most.friction[i]:.3g} % of critical, under "
        f"{newtons(most.load, 4)} at {1e6 * most.amplitude[i]:.4g} um"
    ]
    reached = [one for one in found if np.isfinite(one.error)]
    if reached:
        worst = max(reached, key=lambda one: abs(one.error))
        sentences.append(
            "resonances predicted by the nonlinear mode alone are off by "
            f"{percent(abs(worst.error))} of the balance's amplitude at most, under "
            f"{newtons(worst.load, 4)}"
        )
    for one in found:
        if one.fold.any():
            turns = " and ".join(
                f"{1e6 * one.amplitude[i]:.4g} um ({one.frequency[i]:.5g} Hz)"
                for i in np.flatnonzero(one.fold)
            )
            sentences.append(
                f"load {newtons(one.load)}: the nonlinear mode turns back in amplitude at {turns}; "
                "several motions share the amplitudes between"
            )
        lost = np.flatnonzero(~one.converged)
        if len(lost):
            first, last = 1e6 * one.wanted[lost].min(), 1e6 * one.wanted[lost].max()
            between = f"from {first:.4g} to {last:.4g} um" if len(lost) > 1 else f"{first:.4g} um"
            sentences.append(
                warning(
                    f"load {newtons(one.load)}: {len(lost)} of {len(one.converged)} amplitudes not "
                    f"solved, {between}: {one.lost}"
                )
            )
        if len(one.resonances) > 1:
            others = " and ".join(
                f"{1e6 * height:.4g} um ({at:.5g} Hz)" for height, at in one.resonances[1:]
            )
            sentences.append(
                warning(
                    f"load {newtons(one.load)}: the force also keeps the mode up to {others}, in "
                    "motions detached from those that grow from rest; a strong drive may lead there"
                )
            )
        if not np.isfinite(one.error):
            sentences.append(
                warning(f"load {newtons(one.load)}: the mode reaches no resonance under this force")
            )
    return sentences


def backbone_headlines(run: SolvedRun, found: Sequence[Backbone]) -> list[Headline]:
    """The lowest resonance by its mode, with the error of the balance that judges it, and the
    damping there.
    """
    best = min(found, key=lambda one: one.balance[0])
    used = best.friction[best.converged].max(initial=0.0)
    of_balance = error_words(balance_error(run, best))
    return [
        Headline(
            "resonance by the nonlinear mode, at the best load studied",
            f"{1e6 * best.predicted[0]:.4g} µm",
            f"off by {100 * best.error:+.2g} % from the balance; the balance itself: {of_balance}",
            f"under {newtons(best.load, 4)} at {best.predicted[1]:.5g} Hz",
        ),
        Headline(
            "largest friction damping under that load",
            f"{100 * used:.3g} %",
            "by the model; no excitation enters",
            "of critical",
        ),
    ]


def balance_error(run: SolvedRun, one: Backbone) -> pd.Series:
    """The estimated error of the balance that a mode stands next to, and the mesh's part in it: as
    in the design table of the run.
    """
    curves = run.response.curves
    (curve,) = (c for c in curves if (c.load, c.mass) == (one.load, one.mass))
    error = np.nan if curve.error is None else curve.error
    return pd.Series({"error": error, "body_mesh": curve.body_mesh}, dtype=float)


def backbone_messages(
    run: SolvedRun,
    found: Sequence[Backbone],
    remarks: Sequence[str] = (),
) -> list[str]:
    """What the page and the terminal say: what makes the balance wrong makes its modes wrong."""
    return [*run.messages, *remarks, *backbone_sentences(found)]


def write_backbones(
    run: SolvedRun,
    found: Sequence[Backbone],
    messages: Sequence[str],
) -> list[Path]:
    """Tables, the design map and a page in the run's folder; returns the files.

    Args:
        messages: `backbone_messages`.
    """
    folder = folder_of(run)
    moved = take_folder(folder, run.scene)
    tables = {"response/backbone_resonances": prediction_table(found, run)}
    write_tables(tables["response/backbone_resonances"], folder / "backbone_resonances", "backbone")
    write_tables(backbone_table(found), folder / "backbone", "backbone")
    points = [(c.frequency[c.converged], c.amplitude[c.converged]) for c in run.response.curves]
    picture = folder / "design_map.png"
    draw_design_map(found, points, run.scene.title, picture)
    pages = write_report(
        folder,
        run.scene,
        tables,
        {"response/design_map": picture},
        [*filter(None, [moved]), *messages],
        run.timings,
        page=Page(numbers=backbone_headlines(run, found), stem="report_backbone"),
    )
    return [folder / "backbone_resonances.csv", folder / "backbone.csv", picture, *pages]
