"""Random models with friction, lift-off, gaps and dampers, and their slow march in time.

The march shares nothing with the library: leapfrog on the modes of the coupled matrices, the return
map of each contact at every step, at least 1000 steps a period. It is the truth that
`branches.py`, `verdicts.py` and `choice_random.py` judge by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import linalg

from bladefem import balance as bf

# steps of a march a period, at least
STEPS = 1000
# steps in the period of the fastest motion, at least
FASTEST = 20
# harmonics whose amplitudes make the height
HARMONICS = 31


@dataclass(frozen=True)
class Case:
    """A model of the library, and the same as plain matrices; d coordinates, n contacts."""

    name: str
    seed: int
    model: bf.ReducedModel
    # (rad/s) round the first resonances
    band: tuple[float, float]
    # (d,) stiffness and (d, d) damping of mass-normalised coordinates
    stiffness: np.ndarray
    damping: np.ndarray
    # (n, 3, d) readings: normal, two tangents
    contact: np.ndarray
    # (n, 4) kt, kn, mu, n0
    table: np.ndarray
    # harmonic to (d,) complex force
    force: dict[int, np.ndarray]
    # (d,) reading of the probe
    probe: np.ndarray

    @property
    def lifts(self) -> bool:
        """Normal loads follow the motion."""
        return bool(np.any(self.table[:, 1] > 0))


def random_case(seed: int, lifts: bool | None = None) -> Case:
    """One model; half of them have contacts that may lift off."""
    rng = np.random.default_rng([16, seed])
    lifts = bool(seed % 2) if lifts is None else lifts
    kind = rng.choice(["pair", "chain", "plate", "floating", "rigid damper", "elastic damper"])
    blade = _body(rng, {"pair": 2, "chain": int(rng.integers(3, 9))}.get(kind, 0), kind)
    tangents = int(rng.choice([1, 1, 2]))
    n = int(rng.integers(1, 4)) if kind == "pair" else int(rng.integers(1, 13))
    n = min(n, 3 * len(blade[0]))
    scale = float(np.median(np.diag(blade[1])))
    e = bf.Elements(
        kt=scale * 10 ** rng.uniform(-1.5, 1.0) / n * rng.uniform(0.5, 1.5, n),
        kn=lifts * scale * 10 ** rng.uniform(-1.5, 1.0) / n * rng.uniform(0.5, 1.5, n),
        mu=np.full(n, rng.uniform(0.05, 1.0)),
        n0=np.ones(n),
        tangents=tangents,
    )
    rows = tangents + int(lifts)
    readings = rng.normal(size=(n * rows, len(blade[0]))) / np.sqrt(len(blade[0]))
    orders = (1,) if rng.random() < 0.7 else tuple(sorted({1, int(rng.choice([2, 3, 5]))}))
    force = {h: (rng.normal(size=2) @ [1, 1j]) * _unit(rng, len(blade[0])) / h for h in orders}
    ports = {
        "contact": readings,
        "load": np.eye(len(blade[0])),
        "probe": _unit(rng, len(blade[0]))[None],
    }
    damper, joined = _damper(rng, kind, blade, readings)
    side = bf.body_from_matrices(*blade[:2], ports, C=blade[2])
    e = _loaded(rng, e, blade, readings, force, lifts)
    model = bf.ReducedModel((side,), e, force, damper=damper)
    return _case(f"{kind} {tangents}", seed, model, joined, e, rows, force, ports["probe"][0])


def _unit(rng: np.random.Generator, size: int) -> np.ndarray:
    x = rng.normal(size=size)
    return x / np.linalg.norm(x)


def _body(rng: np.random.Generator, dofs: int, kind: str) -> tuple[np.ndarray, ...]:
    """M, K, C of a chain, or of a plate's modes mixed into as many degrees of freedom."""
    if kind in ("pair", "chain"):
        K = np.zeros((dofs, dofs))
        for i, k in enumerate(rng.uniform(0.5, 2.0, dofs) * 10 ** rng.uniform(4, 6)):
            K[i, i] += k
            if i:
                K[i - 1, i - 1] += k
                K[i, i - 1] -= k
                K[i - 1, i] -= k
        M = np.diag(rng.uniform(0.3, 3.0, dofs))
    else:
        dofs = int(rng.choice([4, 6, 10, 20, 40], p=[0.3, 0.3, 0.2, 0.1, 0.1]))
        a, b = np.meshgrid(np.arange(1, 8), np.arange(1, 8))
        plate = np.sort((a**2 + rng.uniform(0.3, 1.5) * b**2).ravel())[:dofs]
        omega = 300 * plate / plate[0]
        if rng.random() < 0.3:
            omega[1] = omega[0] * rng.uniform(1.01, 1.05)
        if rng.random() < 0.3:
            omega[-1] = omega[0] * rng.choice([3, 5]) * rng.uniform(0.98, 1.02)
        mix = linalg.qr(rng.normal(size=(dofs, dofs)))[0]
        M = np.eye(dofs)
        K = mix @ np.diag(omega**2) @ mix.T
        if kind == "floating":
            K -= mix[:, :1] @ mix[:, :1].T * omega[0] ** 2
    values = linalg.eigvalsh(K, M)
    first = np.sqrt(values[values > 1e-8 * values[-1]][0])
    ratio = 10 ** rng.uniform(-2.7, -1.5)
    C = 2 * ratio / first * K + (0.2 * ratio * first) * M
    if rng.random() < 0.3:
        spread = rng.uniform(0, 1, len(M))
        C = C + 2 * ratio * first * np.diag(spread * np.diag(M))
    if rng.random() < 0.15:
        turn = rng.normal(size=M.shape)
        C = C + 0.3 * first * ratio * (turn - turn.T)
    return M, (K + K.T) / 2, C


def _damper(
    rng: np.random.Generator, kind: str, blade: tuple[np.ndarray, ...], readings: np.ndarray
) -> tuple[object, tuple[np.ndarray, ...]]:
    """The library's damper, and (M, K, C, readings) of blade and damper together."""
    M, K, C = blade
    if kind not in ("rigid damper", "elastic damper"):
        return None, (M, K, C, readings)
    size = int(rng.integers(1, 4))
    B = rng.normal(size=(len(readings), size))
    mass = rng.uniform(0.02, 0.3, size) * np.mean(np.diag(M))
    together = np.hstack([readings, -B])
    if kind == "rigid damper":
        still = np.zeros((size, size))
        joined = (
            linalg.block_diag(M, np.diag(mass)),
            linalg.block_diag(K, still),
            linalg.block_diag(C, still),
            together,
        )
        return bf.RigidBody(np.diag(mass), B), joined
    own = np.median(np.diag(K)) * np.diag(rng.uniform(0.1, 3.0, size))
    loss = 1e-2 * np.sqrt(own * np.diag(mass))
    body = bf.body_from_matrices(np.diag(mass), own, {"contact": B}, C=loss)
    return (body,), (
        linalg.block_diag(M, np.diag(mass)),
        linalg.block_diag(K, own),
        linalg.block_diag(C, loss),
        together,
    )


def _loaded(
    rng: np.random.Generator,
    e: bf.Elements,
    blade: tuple[np.ndarray, ...],
    readings: np.ndarray,
    force: dict[int, np.ndarray],
    lifts: bool,
) -> bf.Elements:
    """Normal loads that the excitation overcomes here and there; gaps where contacts may lift."""
    M, K, C = blade
    values = linalg.eigvalsh(K, M)
    omega = np.sqrt(values[values > 1e-8 * values[-1]][0])
    Z = K - omega**2 * M + 1j * omega * C
    moved = abs(readings @ np.linalg.solve(Z, force[1])).max()
    n = len(e.kt)
    stiffness = np.mean(e.kn) if lifts else np.mean(e.kt * np.maximum(e.mu, 0.1))
    n0 = stiffness * moved * 10 ** rng.uniform(-2, 0) * rng.uniform(0.3, 1.7, n)
    if lifts and rng.random() < 0.4:
        n0 = np.where(rng.random(n) < 0.5, -n0, n0)
    return bf.Elements(kt=e.kt, kn=e.kn, mu=e.mu, n0=n0, tangents=e.tangents)


def _case(
    name: str,
    seed: int,
    model: bf.ReducedModel,
    joined: tuple[np.ndarray, ...],
    e: bf.Elements,
    rows: int,
    force: dict[int, np.ndarray],
    probe: np.ndarray,
) -> Case:
    M, K, C, readings = joined
    values, modes = linalg.eigh(K, M)
    values = np.where(values < 1e-9 * values[-1], 0.0, values)
    n = len(e.kt)
    contact = np.zeros((n, 3, len(M)))
    parts = (readings @ modes).reshape(n, rows, -1)
    first = 0 if rows > e.tangents else 1
    contact[:, first : first + rows] = parts
    spare = len(M) - len(probe)
    stuck = linalg.eigvalsh(K + readings.T @ (np.tile(_springs(e, rows), 1)[:, None] * readings), M)
    low = np.sqrt(values[values > 0][0])
    high = max(np.sqrt(stuck[stuck > 1e-9 * stuck[-1]][0]), low)
    band = 0.75 * min(low, high), 1.2 * high + 0.05 * low
    return Case(
        name,
        seed,
        model,
        (float(band[0]), float(band[1])),
        values,
        modes.T @ C @ modes,
        contact,
        np.column_stack([e.kt, e.kn, e.mu, e.n0]),
        {h: modes.T @ np.pad(f, (0, spare)) for h, f in force.items()},
        np.pad(probe, (0, spare)) @ modes,
    )


def _springs(e: bf.Elements, rows: int) -> np.ndarray:
    tangents = np.repeat(e.kt[:, None], e.tangents, axis=1)
    return (tangents if rows == e.tangents else np.column_stack([e.kn, tangents])).ravel()


@dataclass(frozen=True)
class March:
    """A march at one frequency, from the state where the last one ended."""

    # root of the sum of squares of the harmonics' amplitudes over the last period
    height: float
    # largest difference of the last two periods over the largest motion
    change: float
    # q, velocity, sliders
    state: np.ndarray


def rest(case: Case) -> np.ndarray:
    """q, velocity and sliders of the preload state."""
    n, _, d = case.contact.shape
    return np.zeros(2 * d + 2 * n)


def march(case: Case, omega: float, state: np.ndarray, periods: int, least: int = STEPS) -> March:
    """Some periods from a state at phase zero, of so many steps at least."""
    d = len(case.stiffness)
    springs = case.table[:, [1, 0, 0]].ravel()
    P = case.contact.reshape(-1, d)
    fast = linalg.eigvalsh(np.diag(case.stiffness) + P.T @ (springs[:, None] * P))[-1]
    steps = max(least, int(np.ceil(FASTEST * np.sqrt(fast) / omega)))
    steps = 64 * -(-steps // 64)
    orders = np.array(sorted(case.force), dtype=np.int64)
    force = np.array([case.force[h] for h in orders])
    y = state.copy()
    history = np.empty((2, steps))
    _leapfrog(
        y,
        omega,
        periods,
        steps,
        case.stiffness,
        case.damping,
        case.contact,
        case.table,
        orders,
        force,
        case.probe,
        history,
    )
    lines = 2 / steps * np.fft.rfft(history[1])[1 : HARMONICS + 1]
    size = max(abs(history).max(), 1e-300)
    return March(
        float(np.sqrt(np.sum(abs(lines) ** 2))), float(abs(history[1] - history[0]).max() / size), y
    )


@njit(cache=True, error_model="numpy")
def _leapfrog(y, omega, periods, steps, L, D, contact, table, orders, force, probe, history):
    n, _, d = contact.shape
    dt = 2 * np.pi / omega / steps
    q = y[:d]
    v = y[d : 2 * d]
    a = np.empty(d)
    z = y[2 * d :].reshape(n, 2)
    cos = np.empty((orders.size, steps))
    sin = np.empty((orders.size, steps))
    # readings of the step before: an open contact lands between two steps, and begins to stick
    # where it was then. Begun at the last step before, the map of a period is a staircase of the
    # states, on which small disturbances of an unstable motion decay.
    before = np.zeros((n, 3))
    known = False
    diagonal = True
    for i in range(d):
        for j in range(d):
            if i != j and abs(D[i, j]) > 1e-9 * abs(D[i, i]):
                diagonal = False
    for h in range(orders.size):
        for k in range(steps):
            cos[h, k] = np.cos(orders[h] * 2 * np.pi * k / steps)
            sin[h, k] = np.sin(orders[h] * 2 * np.pi * k / steps)
    for period in range(periods):
        for k in range(steps):
            for i in range(d):
                a[i] = -L[i] * q[i]
                for h in range(orders.size):
                    a[i] += force[h, i].real * cos[h, k] - force[h, i].imag * sin[h, k]
            if diagonal:
                for i in range(d):
                    a[i] -= D[i, i] * v[i]
            else:
                for i in range(d):
                    for j in range(d):
                        a[i] -= D[i, j] * v[j]
            for c in range(n):
                kt, kn, mu, n0 = table[c]
                N = n0
                x = 0.0
                u = 0.0
                w = 0.0
                for i in range(d):
                    x += contact[c, 0, i] * q[i]
                    u += contact[c, 1, i] * q[i]
                    w += contact[c, 2, i] * q[i]
                N = max(n0 + kn * x, 0.0)
                gap = -(n0 + kn * before[c, 0])
                if known and N > 0.0 and gap > 0.0:
                    share = gap / (gap + N)
                    z[c, 0] = before[c, 1] + share * (u - before[c, 1])
                    z[c, 1] = before[c, 2] + share * (w - before[c, 2])
                before[c, 0] = x
                before[c, 1] = u
                before[c, 2] = w
                fu = kt * (u - z[c, 0])
                fw = kt * (w - z[c, 1])
                size = np.sqrt(fu * fu + fw * fw)
                if size > mu * N:
                    share = mu * N / size
                    fu *= share
                    fw *= share
                    z[c, 0] = u - fu / kt
                    z[c, 1] = w - fw / kt
                push = N - max(n0, 0.0) if kn > 0 else 0.0
                for i in range(d):
                    a[i] -= contact[c, 0, i] * push + contact[c, 1, i] * fu + contact[c, 2, i] * fw
            known = True
            seen = 0.0
            for i in range(d):
                v[i] += dt * a[i]
                seen += probe[i] * q[i]
                q[i] += dt * v[i]
            if period >= periods - 2:
                history[period - periods + 2, k] = seen


def state_of(case: Case, point: bf.Solution) -> np.ndarray:
    """q, velocity and sliders of a solution of the balance at phase zero."""
    n, _, d = case.contact.shape
    H = point.harmonics
    first = 0 if case.lifts else 1
    rows = case.contact[:, first : first + _directions(case)].reshape(-1, d)
    f = point.f.reshape(len(rows), -1)
    w = point.w.reshape(len(rows), -1)
    preload = np.zeros((n, _directions(case)))
    if case.lifts:
        preload[:, 0] = np.maximum(case.table[:, 3], 0.0)
    q = np.zeros((H + 1, d), dtype=complex)
    for h in range(H + 1):
        force = f[:, 2 * h - 1] - 1j * f[:, 2 * h] if h else f[:, 0] - preload.ravel()
        load = case.force.get(h, 0.0) - rows.T @ force
        still = case.stiffness == 0
        Z = np.diag(case.stiffness) - (h * point.omega) ** 2 * np.eye(d)
        Z = Z + 1j * h * point.omega * case.damping
        if h:
            q[h] = np.linalg.solve(Z, load)
            continue
        q[0, ~still] = load[~still] / case.stiffness[~still]
        missing = w[:, 0] - rows @ q[0].real
        q[0, still] = np.linalg.lstsq(rows[:, still], missing, rcond=1e-9)[0]
    v = (1j * point.omega * np.arange(H + 1)[:, None] * q).sum(axis=0).real
    q = q.sum(axis=0).real
    forces = (point.f[:, :, 0] + point.f[:, :, 1::2].sum(axis=2))[:, int(case.lifts) :]
    z = np.zeros((n, 2))
    for c in range(forces.shape[1]):
        z[:, c] = case.contact[:, 1 + c] @ q - forces[:, c] / case.table[:, 0]
    return np.concatenate([q, v, z.ravel()])


def _directions(case: Case) -> int:
    return case.model.elements.tangents + int(case.lifts)
