"""Numerical settings of the balance: the user's where given, else chosen by the indicators."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..scene import Scene

__all__ = ["DAMPERS", "Settings", "enriched", "first_settings"]

DAMPERS = ("mass", "rigid", "elastic")      # from poor to rich
RICHEST = {"modes": 160, "harmonics": 31, "samples": 4096}


@dataclass(frozen=True)
class Settings:
    """What the balance runs with, and how sure it is."""

    modes: int                      # in each nodal diameter
    harmonics: int
    samples: int                    # a period
    damper: str                     # one of DAMPERS
    error: float | None = None      # estimated relative error of the resonance amplitude, None before the check
    chosen: tuple[str, ...] = ()    # names that are chosen here and not by the user

    def sentence(self) -> str:
        """The settings in words."""
        error = "not estimated" if self.error is None else f"estimated error {100 * self.error:.2g} %"
        kind = "chosen: " + ", ".join(self.chosen) if self.chosen else "all given by the scene"
        return (f"model: {self.modes} modes, {self.harmonics} harmonics, {self.samples} samples, {self.damper} damper "
                f"({error}; {kind})")


def first_settings(scene: Scene) -> Settings:
    """Where the choice starts: the smallest model that the indicators can judge."""
    guess = {"modes": 20, "harmonics": 1, "samples": 64, "damper": "rigid"}
    given = {name: getattr(scene.model, name) for name in guess}
    settings = Settings(**{name: guess[name] if value is None else value for name, value in given.items()},
                        chosen=tuple(name for name, value in given.items() if value is None))
    return _enough_samples(settings)


def enriched(settings: Settings, name: str) -> Settings | None:
    """The next richer settings in one respect; None where there is none."""
    value = getattr(settings, name)
    if name == "damper":
        place = DAMPERS.index(value) + 1
        return replace(settings, damper=DAMPERS[place]) if place < len(DAMPERS) else None
    more = 2 * value + 1 if name == "harmonics" else 2 * value
    return _enough_samples(replace(settings, **{name: more})) if more <= RICHEST[name] else None


def _enough_samples(settings: Settings) -> Settings:
    """At least eight samples in the period of the highest harmonic, where the user left them open."""
    least = 8 * (settings.harmonics + 1)
    return replace(settings, samples=least) if "samples" in settings.chosen and settings.samples < least else settings
