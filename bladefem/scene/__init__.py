"""Scenes: what an engineer decides, as typed tables, read from TOML and validated.

`units` reads and shows values, `limits` compares them with what a message names.
"""
