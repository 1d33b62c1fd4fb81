"""The blade's motion at a damped resonance: drawn at the phase at which it is largest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.colors import Normalize

from bladefem.util.arrays import ComplexArray, RealArray
from geometry.mesh import Mesh

from .mesh import RADIAL_DIRECTION, view_of
from .modes import DRAWN_DISPLACEMENT_SHARE, add_colour_bar, photograph_shape
from .style import SEQUENTIAL_COLOURS, canvas, headline, show_photograph, size_for

# phases of a period at which a motion is looked at
PHASES_PER_PERIOD = 72


def draw_motion(
    mesh: Mesh,
    motion: ComplexArray,
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """The sector at the phase of its largest displacement, coloured by amplitude, at rest in grey
    lines; returns the figure.

    Args:
        mesh: the sector or body.
        motion: (H, n_points, dim) complex displacements of harmonics 1..H [m].
        file: PNG to write.
        title: headline.
    """
    shape = displaced(motion, extreme_phase(motion))
    amplitude = amplitude_of(motion)
    factor = drawn_factor(mesh, motion)
    direction = view_of(mesh)
    image = photograph_shape(mesh, shape, factor, direction, values=amplitude)
    with canvas(file, size=size_for(image, margin=1.6)) as ax:
        show_photograph(ax, image, direction, RADIAL_DIRECTION)
        headline(ax.figure, title or "motion at the resonance")
        largest = 1e6 * float(amplitude.max(initial=0.0))
        add_colour_bar(ax, Normalize(0, largest or 1.0), SEQUENTIAL_COLOURS, "amplitude [µm]")
        scale_note = f"displacements drawn {factor:.3g} times as large"
        ax.figure.supxlabel(scale_note, fontsize=7.5, color="#555555")
        return ax.figure


def displaced(motion: ComplexArray, phase: float) -> RealArray:
    """(n_points, dim) displacement [m] at a phase [rad] of harmonic 1."""
    orders = np.arange(1, len(motion) + 1)
    return np.real(np.tensordot(np.exp(1j * orders * phase), motion, axes=1))


def amplitude_of(motion: ComplexArray) -> RealArray:
    """(n_points,) amplitude of each node [m]: sqrt 2 of the root mean square of its displacement,
    which for one harmonic along a line is the amplitude in the usual sense.
    """
    return np.sqrt(np.sum(np.abs(motion) ** 2, axis=(0, 2)))


def extreme_phase(motion: ComplexArray) -> float:
    """The phase of harmonic 1 [rad] at which some node is displaced most."""
    phases = np.linspace(0.0, 2 * np.pi, PHASES_PER_PERIOD, endpoint=False)
    # no node is displaced by more than its amplitudes together: many never are by as much as some
    # node is at phase 0
    bound = np.linalg.norm(motion, axis=2).sum(axis=0)
    first = np.linalg.norm(displaced(motion, 0.0), axis=1).max(initial=0.0)
    motion = motion[:, bound >= (1 - 1e-9) * first]
    largest = [np.linalg.norm(displaced(motion, phase), axis=1).max() for phase in phases]
    return float(phases[int(np.argmax(largest))])


def drawn_factor(mesh: Mesh, motion: ComplexArray) -> float:
    """Factor that draws the largest amplitude as a tenth of the sector's radial height."""
    largest = amplitude_of(motion).max(initial=0.0)
    return (
        float(DRAWN_DISPLACEMENT_SHARE * np.ptp(mesh.points[:, 0]) / largest)
        if largest > 0
        else 0.0
    )
