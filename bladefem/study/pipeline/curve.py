"""A frequency response under one load, which resonance it gives, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...hbm.solution import Solution, moving_contacts, size
from ...scene.units import newtons
from ...util.arrays import BooleanArray, ComplexArray, IntegerArray, RealArray
from ..adaptive.settings import Settings
from ..stability.kept_band import KeptBand
from ..stability.lower_motion import LowerMotion
from ..stability.resonance_in_time import ResonanceInTime
from .load_interval import LoadInterval

# of how far a march with fewer contact points leads from a balance: what it may have too much. On
# the shipped wedge with ground faces, 1100 N, 536 um with 16 points a seat, they keep 517 um, eight
# keep some 460 and four some 480 of it
DOUBT_OF_FEWER_POINTS = 0.5
# friction work over that of the excitation below which it is rounding
ROUNDED_WORK = 1e-9


@dataclass(frozen=True)
class Curve:
    """A frequency response; points in ascending frequency, unconverged ones included and marked."""

    # [N]
    load: float
    # of the damper [kg]; as meshed when None
    mass: float | None
    # with the estimated error at the resonance
    settings: Settings
    # (k,) [Hz]
    frequency: RealArray
    # (k,) root of the sum of squares of the harmonics at the probe [m]
    amplitude: RealArray
    # (k,) complex first harmonic at the probe [m]
    first: ComplexArray
    # (k,) bool
    converged: BooleanArray
    # (k,) text
    method: np.ndarray
    # (k,) text: the way of `bladefem.hbm.policy` that ran
    route: np.ndarray
    # (k,) relative residual of the balance
    residual: RealArray
    # (k,)
    iterations: IntegerArray
    # (k,) number of elements that slip or lift off in a period
    slipping: IntegerArray
    # (k,) how fast the damper walks where friction alone does not hold it [m/s]
    drift: RealArray
    # (k,) friction work a period [J]
    dissipated: RealArray
    # (k,) |work put in - work lost| over work put in
    imbalance: RealArray
    # (k,) number of the monotone piece of the response; 0 where one motion was looked for
    branch: IntegerArray
    # (k,) estimated relative error of the first harmonic
    estimated: RealArray
    # (k,) the same as wanted: the scene's accuracy times peak over amplitude
    tolerated: RealArray
    # (k,) bool: estimated at this very point; else between its neighbours
    checked: BooleanArray
    # (k,) "unique", "stable", "unstable", "unknown", or "" where it was not asked for
    stability: np.ndarray
    # (k,) largest modulus of the Floquet multipliers; NaN where not computed
    multiplier: RealArray
    # relative change of the peak's height with half of the seats' nodes; NaN: unknown, or small
    # beside the error of contact points
    halved: float
    # the highest converged point that is not unstable, or that is left for a motion whose amplitude
    # is its own within the accuracy, or for one that is not known
    peak: Solution
    # (k,) "fold", "period doubling" or "torus" of unstable points, else ""
    bifurcation: np.ndarray
    # the highest converged point where that one is unstable, else None
    unstable_peak: Solution | None = None
    # what the blade does in time at that one, or at the resonance where that is another unstable
    # point, or one whose verdict is in doubt; None where both are stable
    march_at_peak: KeptBand | None = None
    # the resonance given is unstable, and a march from it keeps to amplitudes farther off than the
    # accuracy, or higher than at the resonance: the highest of these is given in place of that of
    # the balance
    march_replaces_balance: bool = False
    # relative rise above the resonance by marches from unstable motions beside it
    flank_rise: float = 0.0
    # why not all of these marches are known; else ""
    flank_march_failure: str = ""
    # contacts lift off, and marches after a strong drive take too long: a higher motion may exist
    strong_drive_skipped: bool = False
    # another motion at its frequency, far lower, that the blade may keep to instead; None where
    # none was found
    lower: LowerMotion | None = None
    # a march from the resonance that its estimated error was taken from; None where richer balances
    # tell it
    error_march: KeptBand | None = None
    # the resonance that marches from frequency to frequency found where balances do not tell it:
    # its highest amplitude is given
    resonance_by_march: ResonanceInTime | None = None
    # range of the resonance over loading histories; None where it was not asked for
    interval: LoadInterval | None = None
    # contacts lift off and the balance is too large for following its motions round folds: a
    # higher motion may exist
    folds_not_followed: bool = False
    # what the sweep could not do, in sentences
    notes: tuple[str, ...] = ()
    # relative change of the peak's height by the estimated error of the body's mesh; NaN: not
    # estimated
    body_mesh: float = np.nan
    # relative change of the peak's height with the layer's law in place of its tangent, or what is
    # not known of that from a softer layer to the stiff one that it stands for; NaN: not estimated
    layer_law: float = np.nan
    # relative change of the peak's frequency from that softer layer to the stiff one; NaN: none
    # stands for another, or it is not known
    layer_shift: float = np.nan
    # the same of its height, where the stiff one was reached: the resonance given is then that of
    # the stiff layer
    layer_height: float = np.nan

    @property
    def error(self) -> float | None:
        """Estimated relative error of the resonance amplitude: that of the balance, what half as
        many contact points change (the contact mesh), the body's mesh, and the tangent of a layer
        that stiffens; None where it was not asked for.

        A march from an unstable resonance tells the error of its balance as well; one that ends
        above a resonance elsewhere adds to it, and so does the width of one that is given itself,
        and one beside the resonance that rises above it.
        A resonance sought in time has an error of its own in place of the balance's; what contact
        points change is that of the balance, where that tells the same resonance.
        """
        if self.settings.error is None:
            return None
        balance = self.settings.error
        same = self.is_marched_from and not self.march_replaces_balance
        balance = max(balance, self.marched) if same else balance + self.marched
        contact_mesh = self.halved if np.isfinite(self.halved) else 0.0
        if self.resonance_by_march is not None:
            balance = self.resonance_by_march.error
            if abs(self.balance_amplitude / self.curve_amplitude - 1) > balance:
                contact_mesh = 0.0
        body_mesh = 0.0 if np.isnan(self.body_mesh) else self.body_mesh
        layer_law = 0.0 if np.isnan(self.layer_law) else self.layer_law
        return balance + self.flank_rise + contact_mesh + body_mesh + layer_law

    @property
    def marched(self) -> float:
        """How far from the resonance given the blade was marched where the highest motion is
        unstable or in doubt, relative to that resonance: to either side of it where it is that
        motion, above it where it is another. Nothing where a march from there is its error anyway;
        the relative width of the band where its upper end is given, and a share of how far it is
        from the balance where the march had fewer contact points. Without a known march from an
        unstable resonance, infinite.
        """
        march = self.march_at_peak
        if march is None:
            return 0.0
        if march.reason:
            return np.inf if self.keeps_unstable and self.error_march is None else 0.0
        if self.march_replaces_balance:
            return 1 - march.lowest / march.highest + _doubt_of_march(self, march)
        if self.is_marched_from:
            known = self.error_march is not None
            return 0.0 if known else march.farthest(self.curve_amplitude)
        return max(0.0, march.highest / self.curve_amplitude - 1)

    @property
    def is_marched_from(self) -> bool:
        """The march, if there is one, begins at the resonance given, unstable or in doubt."""
        return self.keeps_unstable or self.unstable_peak is None

    @property
    def keeps_unstable(self) -> bool:
        """The highest motion is unstable, and given as the resonance all the same.

        Compared by value: a curve that was read from the run folder has copies.
        """
        top = self.unstable_peak
        return top is not None and (top.omega, size(top)) == (self.peak.omega, size(self.peak))

    @property
    def peak_frequency(self) -> float:
        """[Hz]"""
        if self.reaches_layer:
            return (1 + self.layer_shift) * self.peak.frequency
        found = self.peak if self.resonance_by_march is None else self.resonance_by_march
        return found.frequency

    @property
    def peak_amplitude(self) -> float:
        """Resonance amplitude [m]: of the curve, or of the stiff layer that its softer one stands
        for.
        """
        return self.layer_factor * self.curve_amplitude

    @property
    def layer_factor(self) -> float:
        """The resonance amplitude of the stiff layer over that of the softer one of the curve; 1
        where the curve is that of the layer itself.
        """
        return 1 + self.layer_height if self.reaches_layer else 1.0

    @property
    def reaches_layer(self) -> bool:
        """The curve is that of a softer layer, and the resonance given that of the stiff one."""
        return bool(np.isfinite(self.layer_height))

    @property
    def governing_march(self) -> ResonanceInTime | KeptBand | None:
        """The march whose highest amplitude is given as the resonance; None where a balance is."""
        if self.resonance_by_march is not None:
            return self.resonance_by_march
        return self.march_at_peak if self.march_replaces_balance else None

    @property
    def curve_amplitude(self) -> float:
        """Resonance amplitude of the balance, or the highest that a march keeps to where it
        contradicts the balance [m].
        """
        march = self.governing_march
        return self.balance_amplitude if march is None else march.highest

    @property
    def balance_amplitude(self) -> float:
        """Amplitude of the periodic motion at the resonance [m]."""
        return size(self.peak)

    @property
    def over_balance(self) -> float:
        """The amplitude given over that of the balance: what else follows from the balance's motion
        is reported in proportion.
        """
        return self.peak_amplitude / self.balance_amplitude

    @property
    def is_march(self) -> bool:
        """The resonance given is what a march in time keeps to, not a periodic motion."""
        return self.governing_march is not None

    @property
    def friction_work(self) -> float:
        """Friction work of the motion that is given as the resonance, a period and blade [J]; zero
        where rounding alone leaves some.
        """
        work = self.peak.work.dissipated
        if abs(work) < ROUNDED_WORK * abs(self.peak.work.input):
            work = 0.0
        march = self.governing_march
        return self.layer_factor * float(work if march is None else march.friction_work)

    @property
    def work_over_balance(self) -> float:
        """Friction work at the resonance given over that of its balance; 1 where either is none."""
        ratio = self.friction_work / (self.peak.work.dissipated or np.nan)
        return float(ratio) if np.isfinite(ratio) else 1.0

    @property
    def input_work(self) -> float:
        """Work of the excitation at the resonance given, in proportion to its amplitude [J]."""
        return self.over_balance * float(self.peak.work.input)

    @property
    def slipping_at_peak(self) -> float:
        """Elements that slip or lift off in a period of the resonance given; NaN for a march."""
        return np.nan if self.is_march else moving_contacts(self.peak)

    @property
    def drift_at_peak(self) -> float:
        """How fast the damper walks at the resonance given [m/s]; NaN for a march."""
        return np.nan if self.is_march else float(self.peak.drift)


def load_of(curve: Curve) -> str:
    """ "80 N", with the damper's mass where several are studied."""
    return newtons(curve.load) + ("" if curve.mass is None else f" of {1e3 * curve.mass:.4g} g")


def _doubt_of_march(curve: Curve, kept: KeptBand) -> float:
    """Relative error of a march with fewer contact points than the curve has, from how far it is
    from the balance; 0 for others.
    """
    if kept.points is None:
        return 0.0
    own = curve.settings.points
    if own is not None and kept.points >= own:
        return 0.0
    return DOUBT_OF_FEWER_POINTS * abs(curve.balance_amplitude / kept.highest - 1)
