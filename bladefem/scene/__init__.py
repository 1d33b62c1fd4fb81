"""Scenes: what an engineer decides, as typed tables, read from TOML and validated."""
