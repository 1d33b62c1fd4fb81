"""Numerical settings of the balance: the user's where given, else chosen by the indicators."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, inf, log2, sqrt
from typing import Any

from ...scene.tables import Scene
from ...util.percent import percent

# from poor to rich
DAMPER_MODELS = ("mass", "rigid", "elastic")
# in which a model is enriched
DIRECTIONS = ("harmonics", "samples", "modes", "points", "damper")
RICHEST_SETTINGS = {"modes": 160, "harmonics": 31, "samples": 4096, "points": 4096}
# how many times smaller an error has to be for two steps of the first harmonics at once
DOUBLE_STEP_RATIO = 40.0
FIRST_SETTINGS: dict[str, Any] = {
    "modes": 10,
    "harmonics": 1,
    "samples": 64,
    "points": 4,
    "damper": "rigid",
}


@dataclass(frozen=True)
class Settings:
    """What the balance runs with, and how sure it is."""

    # in each nodal diameter
    modes: int
    harmonics: int
    # a period
    samples: int
    # one of DAMPER_MODELS
    damper: str
    # friction elements on each patch; None: all that there are
    points: int | None = None
    # harmonics beyond which the choice does not go
    most: int = 31
    # relative, of the resonance amplitude; None before the check, inf: unknown
    error: float | None = None
    # names that are chosen here and not by the user
    chosen: tuple[str, ...] = ()
    # a stiff layer is taken as soft as its friction elements, see adaptive.stiff_layer
    softened: bool = False

    @property
    def method(self) -> str:
        """How a point is solved, and why so; measured by benchmarks/choice_methods.py."""
        kind = "balance of harmonics"
        if self.harmonics == 1:
            kind = (
                "equivalent linearisation, which is the balance of one harmonic and whose error "
                "the next ones estimate,"
            )
        if self.samples == 0:
            return (
                f"method: {kind} by Newton, slip and lift-off located exactly, as the scene asks "
                "for"
            )
        return (
            f"method: {kind} by Newton with friction sampled, because no other method is faster "
            "where it is as accurate"
        )

    @property
    def error_words(self) -> str:
        """What the choice knows of the error of these settings."""
        if self.error is None:
            return "not estimated"
        if self.error == inf:
            return "error unknown: richer models were not solved"
        return f"estimated error {percent(self.error)}"

    def sentence(self, nodes: int | None = None, error_text: str = "") -> str:
        """The settings in words.

        Args:
            nodes: those that a seat has, where known.
            error_text: what is known of their errors, in place of that of the choice.
        """
        error = error_text or self.error_words
        kind = "chosen: " + ", ".join(self.chosen) if self.chosen else "all given by the scene"
        points = (
            "all contact points"
            if self.points is None
            else f"up to {self.points} contact points on each seat"
        )
        if nodes is not None:
            some = self.points is not None and self.points < nodes
            points = (
                f"{self.points} of {nodes} contact points on each seat"
                if some
                else f"all {nodes} contact points of each seat"
            )
        harmonics = "1 harmonic" if self.harmonics == 1 else f"{self.harmonics} harmonics"
        layer = ", a softer layer in place of the stiff one" if self.softened else ""
        return (
            f"model: {self.modes} modes, {harmonics}, {self.samples} samples, "
            f"{points}, {self.damper} damper{layer} ({error}; {kind})"
        )


def same_settings(one: Settings, other: Settings) -> bool:
    """They solve the same equations: equal but for their errors."""
    return replace(one, error=None) == replace(other, error=None)


def scene_line(settings: Settings) -> str:
    """What makes a scene run with these settings: a line of TOML for its beginning.

    >>> print(scene_line(Settings(10, 3, 64, "rigid", 4)))
    model = {modes = 10, harmonics = 3, samples = 64, damper = "rigid"}, points = 4 under [contact]
    """
    model = (
        f"model = {{modes = {settings.modes}, harmonics = {settings.harmonics}, "
        f'samples = {settings.samples}, damper = "{settings.damper}"}}'
    )
    return (
        model if settings.points is None else f"{model}, points = {settings.points} under [contact]"
    )


def first_for(modes: int, dampers: bool = False) -> Settings:
    """Where the choice starts for a model without a scene: everything open.

    Args:
        modes: most that there are.
        dampers: whether there are several damper models.
    """
    names = tuple(name for name in DIRECTIONS if dampers or name != "damper")
    return Settings(
        **(FIRST_SETTINGS | {"modes": min(FIRST_SETTINGS["modes"], modes)}), chosen=names
    )


def first_settings(scene: Scene) -> Settings:
    """Where the choice starts: the smallest model that the indicators can judge."""
    given = {name: getattr(scene.model, name) for name in FIRST_SETTINGS if name != "points"}
    guess = FIRST_SETTINGS | {"modes": max(FIRST_SETTINGS["modes"], scene.excitation.mode + 6)}
    settings = Settings(
        **{name: guess[name] if value is None else value for name, value in given.items()},
        points=FIRST_SETTINGS["points"] if scene.contact.points is None else None,
        chosen=tuple(
            name
            for name, value in (given | {"points": scene.contact.points}).items()
            if value is None
        ),
    )
    return _enough_samples(settings)


def enriched_settings(
    settings: Settings,
    name: str,
    need: float = 4.0,
) -> Settings | None:
    """The next richer settings in one respect; None where there is none.

    Args:
        need: how many times smaller the error should become; a step of the harmonics (1, 3, 7, ...)
            gives a factor of eight or so, a doubling of samples and points four, so that a large
            need takes several at once.
    """
    value = getattr(settings, name)
    if name == "damper":
        place = DAMPER_MODELS.index(value) + 1
        return (
            replace(settings, damper=DAMPER_MODELS[place]) if place < len(DAMPER_MODELS) else None
        )
    if value is None:
        return None
    if name == "harmonics":
        more = 4 * value + 3 if value < 7 and need > DOUBLE_STEP_RATIO else 2 * value + 1
    elif name == "modes":
        more = 2 * value
    else:
        more = value * 2 ** min(
            max(ceil(log2(sqrt(max(need, 1.0)))), 1), 2 if name == "points" else 3
        )
    more = min(more, RICHEST_SETTINGS[name], settings.most if name == "harmonics" else more)
    return _enough_samples(replace(settings, **{name: more})) if more > value else None


def restarted_settings(settings: Settings) -> Settings:
    """Back to the start in what is cheap to choose again; modes and damper model are kept for the
    next load case.
    """
    names = [name for name in ("harmonics", "samples", "points") if name in settings.chosen]
    return _enough_samples(
        replace(
            settings,
            **{name: FIRST_SETTINGS[name] for name in names},
            error=None,
            softened=False,
        )
    )


def _enough_samples(settings: Settings) -> Settings:
    """At least eight samples in the period of the highest harmonic, where the user left them
    open.
    """
    least = 8 * (settings.harmonics + 1)
    return (
        replace(settings, samples=least)
        if "samples" in settings.chosen and settings.samples < least
        else settings
    )
