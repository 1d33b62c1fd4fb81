"""A march from an unstable motion, exact between changes of contact state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...damper.branch import state_of
from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution
from ...hbm.time_model import time_system
from ...time.event_integrator import State, Trajectory, integrate_periods
from .kept_band import (
    DISTURBANCE_SHARE,
    LONGER_WHILE_WIDENING,
    KeptBand,
    band_of,
    too_long_reason,
    unknown_band,
    widens_at_end,
)
from .verdicts import in_one_body

# periods before the amplitudes are taken, and those in which they are
LEFT_PERIODS = 300
KEPT_PERIODS = 100
# instants of a period
SAMPLES_PER_PERIOD = 256
# steps of the whole march above which it is not begun: some 20 s
MAX_STEPS = 4e6
SECONDS_PER_STEP = 5e-6


def exact_band(model: ReducedModel, point: Solution) -> KeptBand | None:
    """Band of amplitudes by event-exact integration; None where contacts have two tangents, or
    waves travel.
    """
    try:
        system = time_system(in_one_body(model), point.harmonics)
    except InputError:
        return None
    periods = LEFT_PERIODS + KEPT_PERIODS
    steps = periods * max(SAMPLES_PER_PERIOD, 2 * np.pi * system.fastest / point.omega)
    if steps > MAX_STEPS:
        return unknown_band(point, too_long_reason(steps * SECONDS_PER_STEP))
    start = state_of(point, system)
    state = State((1 + DISTURBANCE_SHARE) * start.q, start.v, start.z)
    left = integrate_periods(system, point.omega, state, SAMPLES_PER_PERIOD, LEFT_PERIODS)
    state, marched, per_period = left.state, LEFT_PERIODS, steps / periods
    while True:
        kept = integrate_periods(system, point.omega, state, SAMPLES_PER_PERIOD, KEPT_PERIODS)
        if kept.reason != "done":
            return unknown_band(point, kept.reason)
        state, marched = kept.state, marched + KEPT_PERIODS
        motion = (kept.q @ system.probe[0]).reshape(KEPT_PERIODS, SAMPLES_PER_PERIOD)
        most = min(LONGER_WHILE_WIDENING * periods, MAX_STEPS / per_period)
        widens = widens_at_end(motion[:, None], point)
        if not widens or marched + KEPT_PERIODS > most:
            spent = float(_work_of_friction(kept) / KEPT_PERIODS)
            return replace(band_of(point, motion, marched, spent), widens=widens)


def _work_of_friction(path: Trajectory) -> float:
    """Work of the friction forces along a trajectory, by the trapezoidal rule [J]."""
    means = (path.force[1:] + path.force[:-1]) / 2
    return float(np.sum(means * np.diff(path.w, axis=0)))
