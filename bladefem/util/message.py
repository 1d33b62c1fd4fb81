"""What a run has to say: sentences with a level, so that warnings are not lost."""

from __future__ import annotations

from collections.abc import Iterable

# in the order in which a report prints them
LEVELS = ("warning", "information", "method", "timing")


class Message(str):
    """A sentence with a level; it prints and compares like the plain text.

    >>> note = Message("the mesh is coarse", "warning")
    >>> note, note.level
    ('the mesh is coarse', 'warning')
    """

    level: str

    def __new__(
        cls,
        text: str,
        level: str = "information",
    ) -> Message:
        """A sentence of one of LEVELS."""
        if level not in LEVELS:
            raise ValueError(f"level {level!r}: expected one of {', '.join(LEVELS)}")
        message = super().__new__(cls, text)
        message.level = level
        return message


def warning(text: str) -> Message:
    """Something that may make the answer wrong."""
    return Message(text, "warning")


def method(text: str) -> Message:
    """How something was computed, and how far that reaches."""
    return Message(text, "method")


def by_level(messages: Iterable[str]) -> dict[str, list[str]]:
    """Sentences by level, without repetitions; plain texts are information.

    >>> by_level(["a", warning("b"), "a"])
    {'warning': ['b'], 'information': ['a'], 'method': [], 'timing': []}
    """
    found: dict[str, list[str]] = {level: [] for level in LEVELS}
    for message in dict.fromkeys(messages):
        level = message.level if isinstance(message, Message) else "information"
        found[level].append(str(message))
    return found
