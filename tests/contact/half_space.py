"""Elastic half-space under pressure that is constant on rectangles: an independent source of
contact flexibilities.
"""

import numpy as np


def rectangle_flexibility(x, y, hx, hy, modulus):
    """(n, n) normal displacement of node i under a unit force spread over the rectangle of node j
    [m/N].

    x, y (n,) centres [m]; hx, hy sides [m]; modulus E* = E / (1 - nu^2) [Pa].
    Source: Love 1929 as in Johnson, Contact Mechanics (1985), Eq. 3.25.
    """
    dx, dy = x[:, None] - x[None, :], y[:, None] - y[None, :]

    def term(a, b):
        return a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b))

    xp, xm, yp, ym = dx + hx / 2, dx - hx / 2, dy + hy / 2, dy - hy / 2
    return (term(xp, yp) - term(xp, ym) - term(xm, yp) + term(xm, ym)) / (np.pi * modulus * hx * hy)


def square_grid(n, half_width):
    """Centres (n^2,) of a square grid over (-half_width, half_width)^2, and its cell size."""
    h = 2 * half_width / n
    s = -half_width + h * (np.arange(n) + 0.5)
    x, y = np.meshgrid(s, s, indexing="ij")
    return x.ravel(), y.ravel(), h
