"""How a wheel is built: the folder ``geometry`` is installed as ``bladefem.geometry``.

In a checkout it stands at the top, beside ``bladefem``, where its readers look for it. In other
people's site-packages a package called ``geometry`` would meet theirs, so that the wheel holds it
inside of ``bladefem``, and the imports in the wheel's copies of the sources say so.
"""

from __future__ import annotations

import re
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

# imports, "module:function" references, and names of packages whose sources are hashed
REFERENCES = (
    (re.compile(r"^(\s*)(from|import) geometry\b", re.MULTILINE), r"\1\2 bladefem.geometry"),
    (re.compile(r'"geometry(\.[a-z_0-9.]+(?::[a-z_0-9]+)?)"'), r'"bladefem.geometry\1"'),
    (re.compile(r'code=\("geometry",'), 'code=("bladefem.geometry",'),
)


def inside_bladefem(text: str) -> str:
    """A source text whose references to ``geometry`` mean ``bladefem.geometry``."""
    for pattern, replacement in REFERENCES:
        text = pattern.sub(replacement, text)
    return text


class BuildInsideBladefem(build_py):
    """Moves ``geometry`` into ``bladefem`` in the build folder; editable installs stay as they
    are.
    """

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        library = Path(self.build_lib)
        moved = library / "bladefem" / "geometry"
        moved.parent.mkdir(parents=True, exist_ok=True)
        if (library / "geometry").is_dir():
            self.copy_tree(str(library / "geometry"), str(moved))
            for file in sorted((library / "geometry").rglob("*"), reverse=True):
                file.rmdir() if file.is_dir() else file.unlink()
            (library / "geometry").rmdir()
        for file in (library / "bladefem").rglob("*.py"):
            text = file.read_text(encoding="utf-8")
            file.write_text(inside_bladefem(text), encoding="utf-8")


setup(cmdclass={"build_py": BuildInsideBladefem})
