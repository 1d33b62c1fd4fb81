"""Which files a picture can be written to."""

from __future__ import annotations

# ends of their names
PICTURES = (".png", ".pdf", ".svg", ".jpg")
