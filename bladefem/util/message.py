"""What a run has to say: sentences with a level, so that warnings are not lost."""

from __future__ import annotations

from collections.abc import Iterable

# in the order in which a report prints them
LEVELS = ("warning", "information", "method", "timing")


class Message(str):
    """A sentence with a level; it prints and compares like the plain text.

    Attributes:
        level: one of LEVELS.
        advice: what the reader can do about it; "" where nothing is left to do.
        detail: figures and reasons, for a page rather than for a terminal.

    >>> note = Message("the mesh is coarse", "warning", "a smaller mesh.size")
    >>> note, note.level, note.advice
    ('the mesh is coarse', 'warning', 'a smaller mesh.size')
    """

    level: str
    advice: str
    detail: str

    def __new__(
        cls,
        text: str,
        level: str = "information",
        advice: str = "",
        detail: str = "",
    ) -> Message:
        """A sentence of one of LEVELS."""
        if level not in LEVELS:
            raise ValueError(f"level {level!r}: expected one of {', '.join(LEVELS)}")
        message = super().__new__(cls, text)
        message.level = level
        message.advice = advice
        message.detail = detail
        return message

    @property
    def parts(self) -> tuple[str, str, str]:
        """Sentence, advice and detail as plain texts."""
        return str(self), self.advice, self.detail


def warning(text: str, advice: str = "", detail: str = "") -> Message:
    """Something that may make the answer wrong."""
    return Message(text, "warning", advice, detail)


def method(text: str, detail: str = "") -> Message:
    """How something was computed, and how far that reaches."""
    return Message(text, "method", detail=detail)


def by_level(messages: Iterable[str]) -> dict[str, list[Message]]:
    """Messages by level, without repetitions; plain texts are information.

    >>> by_level(["a", warning("b"), "a"])
    {'warning': ['b'], 'information': ['a'], 'method': [], 'timing': []}
    """
    found: dict[str, dict[tuple[str, str, str], Message]] = {level: {} for level in LEVELS}
    for text in messages:
        message = text if isinstance(text, Message) else Message(text)
        found[message.level].setdefault(message.parts, message)
    return {level: list(said.values()) for level, said in found.items()}
