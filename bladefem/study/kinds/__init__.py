"""The stages of the verification kinds: Hertz, punch, Z-mass."""
