"""Real Fourier coefficients [mean, cos 1, sin 1, ..., cos H, sin H] of periodic motion, and their
complex twins.

q(tau) = q0 + sum_h (c_h cos h tau + s_h sin h tau) = Re sum_h q_h e^{j h tau}, so that c_h = Re
q_h, s_h = -Im q_h. The coefficients are always on the last axis.
"""

from __future__ import annotations

import numpy as np

from bladefem.errors import InputError


def harmonics_of(coefficients: np.ndarray) -> int:
    """The highest harmonic H of real coefficients (..., 2H+1)."""
    size = np.shape(coefficients)[-1]
    if size % 2 == 0:
        raise InputError(
            f"coefficients: last axis has {size} entries, expected 2H+1 (mean, then cos and sin "
            "pairs)"
        )
    return size // 2


def to_complex(coefficients: np.ndarray) -> np.ndarray:
    """Real coefficients (..., 2H+1) as complex amplitudes (..., H+1) of e^{j h tau}; the mean is
    real.
    """
    c = np.asarray(coefficients, dtype=float)
    q = np.empty((*c.shape[:-1], harmonics_of(c) + 1), dtype=complex)
    q[..., 0] = c[..., 0]
    q[..., 1:] = c[..., 1::2] - 1j * c[..., 2::2]
    return q


def to_real(amplitudes: np.ndarray) -> np.ndarray:
    """Complex amplitudes (..., H+1) of e^{j h tau} as real coefficients (..., 2H+1)."""
    q = np.asarray(amplitudes)
    c = np.empty((*q.shape[:-1], 2 * q.shape[-1] - 1))
    c[..., 0] = q[..., 0].real
    c[..., 1::2] = q[..., 1:].real
    c[..., 2::2] = -q[..., 1:].imag
    return c


def sample_instants(samples: int) -> np.ndarray:
    """(samples,) instants tau = 2 pi i / samples of one period [rad]."""
    return 2 * np.pi / samples * np.arange(samples)


def synthesis(
    H: int,
    samples: int,
    shift: float = 0.0,
) -> np.ndarray:
    """(samples, 2H+1) matrix from coefficients to values at tau = 2 pi (i + shift) / samples."""
    phase = np.outer(sample_instants(samples) + 2 * np.pi * shift / samples, np.arange(1, H + 1))
    T = np.ones((samples, 2 * H + 1))
    T[:, 1::2] = np.cos(phase)
    T[:, 2::2] = np.sin(phase)
    return T


def analysis(H: int, samples: int) -> np.ndarray:
    """(2H+1, samples) matrix from values at tau = 2 pi i / samples to coefficients; needs samples >
    2H.
    """
    if samples <= 2 * H:
        raise InputError(
            f"samples: {samples} instants cannot carry {H} harmonics, expected more than {2 * H}"
        )
    P = synthesis(H, samples).T * (2 / samples)
    P[0] /= 2
    return np.ascontiguousarray(P)


def derivative(coefficients: np.ndarray) -> np.ndarray:
    """Coefficients of dq/dtau; times the circular frequency it is the velocity."""
    c = np.asarray(coefficients, dtype=float)
    h = np.arange(1, harmonics_of(c) + 1)
    d = np.zeros_like(c)
    d[..., 1::2] = h * c[..., 2::2]
    d[..., 2::2] = -h * c[..., 1::2]
    return d
