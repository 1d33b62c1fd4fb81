"""Public names that are loaded when they are first used, so that importing a package stays cheap
(PEP 562).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module


def lazy_getattr(package: str, where: Mapping[str, str]) -> Callable[[str], object]:
    """What a package's ``__getattr__`` has to be.

    Args:
        package: its ``__name__``.
        where: public name to the module that holds it, relative to the package; "module:name" where
            it is called otherwise there.
    """

    def load(name: str) -> object:
        if name not in where:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        module, _, other = where[name].partition(":")
        return getattr(import_module(module, package), other or name)

    return load
