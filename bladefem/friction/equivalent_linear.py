"""The optimal linear approximation of contact forces, f ~ K_ad u + C_ad du/dt + F_c0 (the paper's
Eq. 7-16, corrected).

Two errors of print are corrected: in Eq. 16 both sums of C carry the factor k, and for a mean
displacement F_c0 is that of Eq. 11, not f_0 alone. With both the approximation does exactly the
work of the force. The sign is that of f, so that K_ad and C_ad are added to the structure and C_ad
is not negative for dry friction. An element that does not move has no approximation: all three are
nan there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bladefem.friction.fourier import derivative, harmonics_of

# of an element's largest harmonic: what is smaller is rounding
ROUNDING_SHARE = 1e-12


@dataclass(frozen=True)
class Approximation:
    """f ~ stiffness u + damping du/dt + constant, for each element; nan where it does not move."""

    # K_ad (...,) [N/m]
    stiffness: np.ndarray
    # C_ad (...,) [N s/m]
    damping: np.ndarray
    # F_c0 (...,) [N]
    constant: np.ndarray


def from_series(
    u: np.ndarray,
    f: np.ndarray,
    omega: float,
) -> Approximation:
    """Least squares over one period sampled at equal steps, u and f (..., samples) (Eq. 11); omega
    in rad/s.

    du/dt is the derivative of the trigonometric interpolation, so that u and du/dt are orthogonal
    as in Eq. 9.
    """
    u = np.asarray(u, dtype=float)
    f = np.asarray(f, dtype=float)
    rate = _time_derivative(u, omega)
    mean = u.mean(-1)
    moving = u - mean[..., None]
    moving[np.abs(moving).max(-1) == 0] = np.nan
    K = (moving * f).mean(-1) / (moving**2).mean(-1)
    with np.errstate(invalid="ignore"):
        C = (rate * f).mean(-1) / (rate**2).mean(-1)
    return Approximation(K, C, f.mean(-1) - K * mean)


def from_harmonics(
    u: np.ndarray,
    f: np.ndarray,
    omega: float,
) -> Approximation:
    """Least squares over one period from coefficients u, f (..., 2H+1) [mean, cos 1, sin 1, ...]
    (Eq. 16, factor k in both sums); omega in rad/s.
    """
    u = np.asarray(u, dtype=float)
    f = np.asarray(f, dtype=float)
    h = np.arange(1, harmonics_of(u) + 1)
    # a f_c - b f_s
    turned = u[..., 2::2] * f[..., 1::2] - u[..., 1::2] * f[..., 2::2]
    size = u[..., 1::2] ** 2 + u[..., 2::2] ** 2
    # 0 / 0 at rest
    with np.errstate(invalid="ignore"):
        K = (u[..., 1:] * f[..., 1:]).sum(-1) / size.sum(-1)
        C = (h * turned).sum(-1) / (omega * (h**2 * size).sum(-1))
    return Approximation(K, C, f[..., 0] - K * u[..., 0])


def matrices_by_harmonic(
    u: np.ndarray,
    f: np.ndarray,
    omega: float,
) -> Approximation:
    """K_ad and C_ad of each harmonic alone, (..., H); nan where the motion does not have it; F_c0
    is the mean force.

    Each harmonic's approximation does the work of that harmonic, and reproduces its amplitude and
    phase.
    """
    u = np.asarray(u, dtype=float)
    f = np.asarray(f, dtype=float)
    h = np.arange(1, harmonics_of(u) + 1)
    cu = u[..., 1::2]
    su = u[..., 2::2]
    cf = f[..., 1::2]
    sf = f[..., 2::2]
    size = cu**2 + su**2
    size = np.where(size > ROUNDING_SHARE**2 * size.max(-1, keepdims=True), size, np.nan)
    return Approximation(
        (cu * cf + su * sf) / size, (su * cf - cu * sf) / (omega * h * size), f[..., 0]
    )


def linear_force(
    approximation: Approximation,
    u: np.ndarray,
    omega: float,
) -> np.ndarray:
    """(..., samples) the linear force [N] on a motion u (..., samples) [m] of one period at equal
    steps.
    """
    K, C, constant = (
        np.asarray(x)[..., None]
        for x in (approximation.stiffness, approximation.damping, approximation.constant)
    )
    return K * u + C * _time_derivative(u, omega) + constant


def work_of(
    approximation: Approximation,
    u: np.ndarray,
    omega: float,
) -> np.ndarray:
    """(...,) work of the averaged approximation on u (..., 2H+1) in one period [J] (Eq. 13); 0 at
    rest.
    """
    return (
        np.pi * omega * np.nan_to_num(approximation.damping) * (derivative(u)[..., 1:] ** 2).sum(-1)
    )


def _time_derivative(u: np.ndarray, omega: float) -> np.ndarray:
    """(..., samples) du/dt of the trigonometric interpolation."""
    S = u.shape[-1]
    spectrum = np.fft.rfft(u) * 1j * np.arange(S // 2 + 1)
    if S % 2 == 0:
        spectrum[..., -1] = 0.0
    return omega * np.fft.irfft(spectrum, S)
