"""Numerical settings of the balance: the user's where given, else chosen; see indicators.py for the choice."""

from __future__ import annotations

from dataclasses import dataclass

from ..scene import Scene

__all__ = ["Settings", "first_settings"]


@dataclass(frozen=True)
class Settings:
    """What the balance runs with, and how sure it is."""

    modes: int
    harmonics: int
    samples: int
    damper: str
    error: float | None = None      # estimated relative error of the resonance amplitude, None before the check
    chosen: tuple[str, ...] = ()    # names that were chosen here and not by the user

    def sentence(self) -> str:
        """The settings in words, the chosen ones marked."""
        parts = (f"{getattr(self, n)} {n}" if n != "damper" else f"{self.damper} damper"
                 for n in ("modes", "harmonics", "samples", "damper"))
        error = "not estimated" if self.error is None else f"estimated error {100 * self.error:.2g} %"
        return f"model: {', '.join(parts)} ({error})"


def first_settings(scene: Scene) -> Settings:
    """Where the choice starts: small, but rich enough that the indicators see."""
    model = scene.model
    guess = {"modes": 20, "harmonics": 3, "samples": 128, "damper": "rigid"}
    given = {name: getattr(model, name) for name in guess}
    return Settings(**{name: guess[name] if value is None else value for name, value in given.items()},
                    chosen=tuple(name for name, value in given.items() if value is None))


def choose_settings(scene, settings, reduced, reduce, join):
    return settings, reduced
