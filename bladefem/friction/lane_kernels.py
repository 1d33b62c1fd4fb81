"""Kernels of 2-D elements in vectors: edges, slip along them, rows of the angle, sums over time.

The arrays of one node along time have rows of ``width`` numbers, samples filled up to a multiple of eight and eight
more. Rows of the derivative have 3 W columns, W the harmonics filled up to a multiple of eight: normal, first, second
tangent. They may be of 8 or of 4 bytes a number, and are filled up to blocks of 64 bytes: M numbers in all.
"""

from __future__ import annotations

from numba import njit

from bladefem.friction.lanes import BLOCK, LANES, Code, kernel

__all__ = ["ACROSS", "AHEAD", "AWAY", "EDGE_ROWS", "FALL", "LIMIT_AHEAD", "LIMIT_AWAY", "TILE", "TURNS", "TWICE_Y",
           "add_folded", "find_edges", "find_forces", "find_turns", "join_rows", "turn_rows"]

(DIRECTION_X, DIRECTION_Y, INVERSE_LENGTH, HALF, SLOPE, INVERSE_LIMIT, AHEAD, ACROSS, AWAY, FALL, LIMIT_AHEAD, TWICE_Y,
 LIMIT_AWAY, EDGE_ROWS) = range(14)
TURNS = 7           # m (3), a, t (3) of find_turns
TILE = 8            # harmonics summed at once
FAINT = 1e-12       # of the limit: the shortest edge
LEAST = 1e-100      # [N]: the least limit


@kernel
def find_edges(code: Code, path, width, mu, out):
    """Fill out (13, width) from path (3, width), which is (kt w_1, kt w_2, N) at the knots [N].

    Rows: direction u (2), 1/length, decay over half an edge, x dln(decay)/dx, 1/limit; of the map of the half-angle
    vector (P, Q) its elements 11, 12 = 21, 22 and determinant; of the form in P and Q whose sign tells whether slip
    goes on its factors of P^2, P Q and -Q^2. Lengths and limits are forces [N].
    """
    mu = code.spread(mu)
    with code.loop(0, code.place(width, -LANES), LANES) as i:
        dx, dy, dN = (code.load(path, (row, width), i, 1) - code.load(path, (row, width), i) for row in range(3))
        limit = mu * (code.load(path, (2, width), i) + 0.5 * dN)
        limit = limit.above(LEAST, limit, limit * 0.0 + LEAST)
        square, least = dx * dx + dy * dy, FAINT * limit
        length = square.above(least * least, square, least * least).sqrt()
        product = 1.0 / (length * limit)
        inverse, inverse_limit = limit * product, length * product
        x = 0.5 * length * inverse_limit
        root = (1.0 + x * x).sqrt()
        half = 1.0 / (root * (root + x))
        ux, uy, slope, half = dx * inverse, dy * inverse, (-1.0 * x) * (root + x) * half, root * half
        fall = half * half
        a, b, growth = 0.5 + 0.5 * fall, 0.5 - 0.5 * fall, mu * dN * inverse
        growth = (code.load(path, (2, width), i, 1)).above(0.0, growth, growth * 0.0 + 2.0)     # opens: no slip goes on
        for row, values in enumerate((ux, uy, inverse, half, slope, inverse_limit, a + b * ux, b * uy, a - b * ux, fall,
                                      ux - growth, 2.0 * uy, ux + growth)):
            code.store(values, out, (row, width), i)


@kernel
def find_turns(code: Code, begin, end, path, form, knots, slips, width, kt, kn, mu, turns, g, normal, trace):
    """How the row of the angle turns along the edges begin <= i < end in slip, from half-angle vectors knots.

    With the pattern's rows p_q (normal, first, second tangent) the row of the angle in the middle of an edge is
    b (row + sum m_q p_q), at its end a row + sum t_q p_q: turns (7, width) takes m, a, t. The force there has the
    rows g (row + ..) + n p_0: g, normal (2, width), zero where slips (width,) is; trace (2, width) takes the force.
    """
    kt, mu = code.spread(kt), code.spread(mu)
    mukn = mu * code.spread(kn)
    with code.loop(code.builder.and_(begin, code.whole(-LANES)), end, LANES) as i:
        form_at = lambda row: code.load(form, (row, width), i)     # noqa: E731
        ux, uy, h, slope = map(form_at, (DIRECTION_X, DIRECTION_Y, HALF, SLOPE))
        P, Q, slip = code.load(knots, i), code.load(knots, width, i), code.load(slips, i)
        N = 0.5 * (code.load(path, (2, width), i) + code.load(path, (2, width), i, 1))
        # twice the parts along and across the direction's half angle, of which the second falls by the decay
        ax, ay = (1.0 + ux) * P + uy * Q, uy * P + (1.0 - ux) * Q
        bx, by = (1.0 - ux) * P - uy * Q, (1.0 + ux) * Q - uy * P
        Pm, Qm, P1, Q1 = ax + h * bx, ay + h * by, ax + h * h * bx, ay + h * h * by
        size, middle, last = 4.0 * (P * P + Q * Q), Pm * Pm + Qm * Qm, P1 * P1 + Q1 * Q1
        inverse = 1.0 / (size * middle * last)
        inverse_middle, inverse_last = size * last * inverse, size * middle * inverse
        ex, ey = (Pm * Pm - Qm * Qm) * inverse_middle, 2.0 * Pm * Qm * inverse_middle
        b, a = h * size * inverse_middle, h * h * size * inverse_last
        ym = slope * (ux * ey - uy * ex)
        y1 = 2.0 * slope * (2.0 * ux * P1 * Q1 - uy * (P1 * P1 - Q1 * Q1)) * inverse_last
        kl, by_load = kt * form_at(INVERSE_LENGTH), mukn * form_at(INVERSE_LIMIT)
        kx, ky, over = kl * ux, kl * uy, middle * (middle * last * inverse) / h
        m = (-1.0 * ym * by_load, ym * kx - (1.0 - b) * ky, ym * ky + (1.0 - b) * kx)
        t = (-1.0 * y1 * by_load, y1 * kx - (1.0 - a) * ky, y1 * ky + (1.0 - a) * kx)
        for row, values in enumerate((*(over * x for x in m), a, *t)):
            code.store(values, turns, (row, width), i)
        R = slip * mu * N
        none = slip * 0.0
        for row, across, along in ((0, -1.0 * ey, ex), (1, ex, ey)):
            code.store(slip.above(0.5, R * b * across, none), g, (row, width), i)
            code.store(slip.above(0.5, mukn * along, none), normal, (row, width), i)
            code.store(slip.above(0.5, R * along, code.load(trace, (row, width), i)), trace, (row, width), i)


@kernel
def find_forces(code: Code, path, form, knots, slips, width, mu, trace):
    """Forces trace (2, width) in the middle of edges in slip [N], from their half-angle vectors knots (2, width)."""
    mu = code.spread(mu)
    with code.loop(0, code.place(width, -LANES), LANES) as i:
        ux, uy, h = (code.load(form, (row, width), i) for row in (DIRECTION_X, DIRECTION_Y, HALF))
        P, Q, slip = code.load(knots, i), code.load(knots, width, i), code.load(slips, i)
        R = 0.5 * mu * (code.load(path, (2, width), i) + code.load(path, (2, width), i, 1))
        P, Q = ((1.0 + ux) * P + uy * Q + h * ((1.0 - ux) * P - uy * Q),
                uy * P + (1.0 - ux) * Q + h * ((1.0 + ux) * Q - uy * P))
        R = R / (P * P + Q * Q)
        for row, along in enumerate((P * P - Q * Q, 2.0 * P * Q)):
            code.store(slip.above(0.5, R * along, code.load(trace, (row, width), i)), trace, (row, width), i)


def _turn_rows(half: bool):
    """Kernel for turn_rows in blocks or halves of blocks."""
    @kernel
    def turn(code: Code, turns, width, at, change, W, begin, end, row, rows, M):
        code, columns = code.half() if half else code, code.whole(M)
        with code.loop(0, W, code.lanes(row)) as l:
            state = [code.variable(code.load(row, (part, W), l)) for part in range(3)]
            with code.loop(begin, end) as i:
                *m, a, t0, t1, t2 = (code.spread(code.one(turns, (q, width), i)) for q in range(TURNS))
                by_load, by_motion = code.load(at, (i, W), l), code.load(change, (i, W), l)
                for part, (t, p) in enumerate(((t0, by_load), (t1, by_motion), (t2, by_motion))):
                    before = code.get(state[part])
                    code.store(before + m[part] * p, rows, (i, columns), (part, W), l)
                    code.set(state[part], t * p + a * before)
            for part in range(3):
                code.store(code.get(state[part]), row, (part, W), l)
    return turn


_turn_blocks, _turn_halves = _turn_rows(False), _turn_rows(True)


@njit(cache=True, error_model="numpy")
def turn_rows(turns, at, change, begin, end, row, rows):
    """Turn the row (M,) of the angle along the edges begin <= i < end; rows (.., M) in their middles, without b.

    turns (7, width) as find_turns has them; at, change (.., W): normal pattern, and that of either tangent.
    """
    width, W, M = turns.shape[1], at.shape[1], row.size
    if W * row.itemsize % BLOCK == 0:
        _turn_blocks(turns, width, at, change, W, begin, end, row, rows, M)
    else:
        _turn_halves(turns, width, at, change, W, begin, end, row, rows, M)


@kernel
def join_rows(code: Code, sums, tiled, M, C, K, W, out):
    """Rows sums (2, tiled, M) + px C[0] + py C[1] without what fills up the K columns of each part: out (2, K, 3K).

    px, py are the columns K and W + K of a row, C (2, M). The last row is left out; blocks reach into the row after.
    """
    code = code.half()
    with code.loop(0, code.place((K, 2), -1)) as n:
        second = code.builder.zext(code.builder.icmp_signed(">=", n, K), n.type)
        row = code.place(n, (second, code.place(tiled, (K, -1))))
        px, py = (code.spread(code.one(sums, (row, M), spot)) for spot in (K, code.place(W, K)))
        for part in range(3):
            with code.loop(0, K, code.lanes(sums)) as l:
                m = code.place((part, W), l)
                joined = code.load(sums, (row, M), m) + px * code.load(C, m) + py * code.load(C, M, m)
                code.store(joined, out, (code.place((n, 3), part), K), l)


def _add_folded(harmonics: int, first: bool):
    """Kernel for a number of harmonics from an even one on; the first one of all has no sine."""
    kinds = [(h, sine) for h in range(harmonics) for sine in (False, True) if h or not first or not sine]

    @kernel
    def add(code: Code, rows, columns, l, g, fours, chosen, count, weights, tile, out, k):
        """Add sum_i weights[i, k + .] g_i rows[i] to the rows of out (.., columns) from k on, a block from column l.

        The sum runs over the chosen (count,) of fours (., 4) of samples i, S/2 - i, S/2 + i, S - i, which are added up
        first: cos and sin of even and odd harmonics are equal there but for their signs.
        """
        sums = [code.variable(code.zeros(out)) for _ in kinds]
        with code.loop(0, count) as n:
            place = code.one(chosen, n)
            four = [code.one(fours, (place, 4), q) for q in range(4)]
            r = [code.load(rows, (i, columns), l) for i in four]
            s = [code.spread(code.one(g, i)) for i in four]
            x, y = s[0] * r[0], s[2] * r[2]
            even, odd, even_back, odd_back = x + s[3] * r[3], x - s[3] * r[3], y + s[1] * r[1], y - s[1] * r[1]
            folded = {(0, False): even + even_back, (1, False): even - even_back,
                      (0, True): odd + odd_back, (1, True): odd - odd_back}
            for q, (h, sine) in enumerate(kinds):
                weight = code.spread(code.one(weights, (place, tile), k, q))
                code.set(sums[q], code.get(sums[q]) + weight * folded[h % 2, sine])
        for q, total in enumerate(sums):
            spot = (code.place(k, q), columns)
            code.store(code.load(out, spot, l) + code.get(total), out, spot, l)
    return add


_add_two, _add_four, _add_six, _add_eight, _add_eight_more = (
    _add_folded(n, first) for n, first in ((2, True), (4, True), (6, True), (8, True), (8, False)))


@njit(cache=True, error_model="numpy")
def add_folded(rows, g, fours, chosen, count, weights, out):
    """Add sum_i weights[i, k] g[e, i] rows[i] over the chosen (count,) of fours (., 4) to out (2, tiled, M)."""
    columns, tile = rows.shape[1], weights.shape[1]
    for l in range(0, columns, BLOCK // rows.itemsize):
        for e in range(2):
            _add_block(rows, columns, l, g[e], fours, chosen, count, weights, tile, out[e])


@njit(cache=True, error_model="numpy")
def _add_block(rows, columns, l, g, fours, chosen, count, weights, tile, out):
    if tile == 3:
        _add_two(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0)
    elif tile == 7:
        _add_four(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0)
    elif tile == 11:
        _add_six(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0)
    else:
        _add_eight(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0)
    for k in range(2 * TILE - 1, tile, 2 * TILE):
        _add_eight_more(rows, columns, l, g, fours, chosen, count, weights, tile, out, k)
