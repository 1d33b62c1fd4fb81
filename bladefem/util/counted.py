"""Numbers of things in words."""


def counted(number: int, noun: str) -> str:
    """A number with its noun.

    >>> counted(1, "point"), counted(3, "point"), counted(0, "wave")
    ('1 point', '3 points', '0 waves')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
