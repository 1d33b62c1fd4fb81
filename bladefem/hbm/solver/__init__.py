"""Solving one point: residual, Newton, iterations, fallbacks, arc length."""
