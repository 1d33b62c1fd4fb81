"""Kernels of 2-D elements in vectors, along the rows of the derivative: their combinations, turns
and sums over time.

A row has 3 W columns, W the K = 2H+1 coefficients filled up to a multiple of eight: normal, first,
second tangent. It may be of 8 or of 4 bytes a number.
"""

from __future__ import annotations

from numba import njit

from bladefem.friction.simd.codegen import BYTES_PER_BLOCK, LANES_PER_VECTOR, Code, Lanes, kernel
from bladefem.friction.simd.time_kernels import TURN_ROWS
from bladefem.util.numba_options import INNER_KERNEL

# harmonics summed at once
HARMONICS_PER_TILE = 8


@kernel
def combine_rows(
    code: Code,
    a,
    first,
    b,
    second,
    by,
    i,
    j,
    knots,
    W,
    out,
):
    """Row out = a first + b second + by[q] knots[i] + by[3 + q] knots[j] in its parts q; knots (..,
    W), by (6,).

    It is summed in double: rows and patterns may cancel each other but for a small part.
    """
    narrow, *by = code.eight(out), *map(code.spread, code.each(by))
    a = code.spread(a)
    b = code.spread(b)
    with code.loop(0, W, LANES_PER_VECTOR) as l:
        here = code.load(knots, (i, W), l)
        ahead = code.load(knots, (j, W), l)
        for part in range(3):
            m = code.place((part, W), l)
            rows = a * code.fit(narrow.load(first, m), knots) + b * code.fit(
                narrow.load(second, m), knots
            )
            code.store(rows + by[part] * here + by[3 + part] * ahead, out, m)


@kernel
def add_products(
    code: Code,
    weights,
    K,
    rows,
    M,
    out,
    tiled,
):
    """Add weights[k] rows[e] to out[e, k]: weights (K,), rows (2, M), out (2, tiled, M)."""
    code = code.eight(out)
    with code.loop(0, M, code.lanes(out)) as l:
        both = [code.load(rows, (e, M), l) for e in range(2)]
        with code.loop(0, K) as k:
            weight = code.spread(code.one(weights, k), out)
            for e, row in enumerate(both):
                spot = code.place((code.place((e, tiled), k), M), l)
                code.store(code.load(out, spot) + weight * row, out, spot)


def _turn_rows(half: bool):
    """Kernel for turn_rows in blocks or halves of blocks."""

    @kernel
    def turn(
        code: Code,
        turns,
        width,
        at,
        change,
        W,
        begin,
        end,
        row,
        rows,
        M,
    ):
        code, columns = code.half() if half else code, code.whole(M)
        with code.loop(0, W, code.lanes(row)) as l:
            state = [code.variable(code.load(row, (part, W), l)) for part in range(3)]
            with code.loop(begin, end) as i:
                *m, a, t0, t1, t2 = (
                    code.spread(code.one(turns, (q, width), i)) for q in range(TURN_ROWS)
                )
                by_load = code.load(at, (i, W), l)
                by_motion = code.load(change, (i, W), l)
                for part, (t, p) in enumerate(((t0, by_load), (t1, by_motion), (t2, by_motion))):
                    before = code.get(state[part])
                    code.store(before + m[part] * p, rows, (i, columns), (part, W), l)
                    code.set(state[part], t * p + a * before)
            for part in range(3):
                code.store(code.get(state[part]), row, (part, W), l)

    return turn


_turn_blocks = _turn_rows(False)
_turn_halves = _turn_rows(True)


@njit(**INNER_KERNEL)
def turn_rows(turns, at, change, begin, end, row, rows):
    """Turn the row (M,) of the angle along the edges begin <= i < end; rows (.., M) in their
    middles, without b.

    turns (7, width) as find_turns has them; at, change (.., W): normal pattern, and that of either
    tangent.
    """
    width = turns.shape[1]
    W = at.shape[1]
    M = row.size
    if W * row.itemsize % BYTES_PER_BLOCK == 0:
        _turn_blocks(turns, width, at, change, W, begin, end, row, rows, M)
    else:
        _turn_halves(turns, width, at, change, W, begin, end, row, rows, M)


@kernel
def fill_gram(
    code: Code,
    around,
    length,
    H,
    K,
    columns,
    out,
):
    """Gram matrix out (K, columns) but for row and column 0, from around (2, length) = (cos, sin
    .., sin, -cos ..).

    The means of cos q and sin q are those from q = -H to 2H.
    """
    with code.loop(1, code.place(H, 1)) as a:
        down = code.place(1, (H, 2), (a, -2))
        up = code.place(1, (H, 2), (a, 2))
        with code.loop(0, K, LANES_PER_VECTOR) as l:
            row = code.place((code.place((a, 2), -1), columns), l)
            rest = code.place(K, (l, -1))
            code.store_first(rest, code.load(around, up, l) + code.load(around, down, l), out, row)
            sine = code.load(around, length, up, l) - code.load(around, length, down, l)
            code.store_first(rest, sine, out, row, columns)


@kernel
def join_rows(
    code: Code,
    sums,
    tiled,
    W,
    C,
    kt,
    gram,
    K,
    out,
):
    """Rows sums (2, tiled, M) + px C[0] + py C[1] without what fills up the K columns of each part:
    out (2, K, 3K).

    px, py are the columns K and W + K of a row, C (2, M). kt gram (K, W) is added in the tangent of
    the row. Blocks reach into the row after, which is written later; the last row is written to its
    end only.
    """
    M = code.place((W, 3))
    code = code.eight(sums)
    kt = code.spread(kt, sums)

    def write(e, k, last):
        row = code.place((code.place((e, tiled), k), M))
        px, py = (code.spread(code.one(sums, row, spot)) for spot in (K, code.place(W, K)))
        for part in range(3):
            with code.loop(0, K, code.lanes(sums)) as l:
                m = code.place((part, W), l)
                joined = code.load(sums, row, m) + px * code.load(C, m) + py * code.load(C, M, m)
                if part == 1 + e:
                    joined = joined + kt * code.load(gram, (k, W), l)
                spot = code.place((code.place((code.place((e, K), k), 3), part), K), l)
                if last:
                    code.store_first(code.place(K, (l, -1)), joined, out, spot)
                else:
                    code.store(joined, out, spot)

    for e in range(2):
        with code.loop(0, code.place(K, -e)) as k:
            write(e, k, False)
    write(1, code.place(K, -1), True)


def _folded_sums(r: list[Lanes]) -> dict[tuple[int, bool], Lanes]:
    """Sums of the rows at samples i, S/2 - i, S/2 + i, S - i, with the signs of cos and sin (True)
    of even (0) and odd (1) harmonics there.
    """
    even = r[0] + r[3]
    odd = r[0] - r[3]
    even_back = r[2] + r[1]
    odd_back = r[2] - r[1]
    return {
        (0, False): even + even_back,
        (1, False): even - even_back,
        (0, True): odd + odd_back,
        (1, True): odd - odd_back,
    }


def _add_folded(
    harmonics: int,
    narrow: bool,
    first: bool = True,
    *,
    load: bool,
):
    """Kernel for a number of harmonics from an even one on; the first one of all has no sine."""
    kinds = [
        (h, sine) for h in range(harmonics) for sine in (False, True) if h or not first or not sine
    ]

    @kernel
    def add(
        code: Code,
        rows,
        columns,
        l,
        g,
        fours,
        chosen,
        count,
        weights,
        tile,
        out,
        k,
        normal,
        at,
        W,
    ):
        """Add sum_i weights[i, k + .] g_i rows[i] to the rows of out (.., columns) from k on, a
        block from column l.

        The sum runs over the chosen (count,) of fours (., 4) of samples i, S/2 - i, S/2 + i, S - i,
        which are added up first: cos and sin of even and odd harmonics are equal there but for
        their signs. With the load, normal_i at[i] is added to g_i rows[i].
        """
        code = code.eight(out) if narrow else code
        sums = [code.variable(code.zeros(out)) for _ in kinds]
        with code.loop(0, count) as n:
            place = code.one(chosen, n)
            four = [code.one(fours, (place, 4), q) for q in range(4)]
            r = [code.spread(code.one(g, i)) * code.load(rows, (i, columns), l) for i in four]
            if load:
                loads = [code.spread(code.one(normal, i)) * code.load(at, (i, W), l) for i in four]
                r = [x + y for x, y in zip(r, loads, strict=True)]
            folded = _folded_sums(r)
            for q, (h, sine) in enumerate(kinds):
                weight = code.spread(code.one(weights, (place, tile), k, q))
                code.set(sums[q], code.get(sums[q]) + weight * folded[h % 2, sine])
        for q, total in enumerate(sums):
            spot = (code.place(k, q), columns)
            code.store(code.load(out, spot, l) + code.get(total), out, spot, l)

    return add


_KINDS = (2, True), (4, True), (6, False), (8, False), (8, True), (8, True, False)
(_add_two, _add_four, _add_six, _add_eight, _add_first_eight, _add_eight_more) = (
    _add_folded(*kind, load=False) for kind in _KINDS
)
(_load_two, _load_four, _load_six, _load_eight, _load_first_eight, _load_eight_more) = (
    _add_folded(*kind, load=True) for kind in _KINDS
)


@njit(**INNER_KERNEL)
def add_folded(rows, g, normal, at, fours, chosen, count, weights, out):
    """Add sum_i weights[i, k] (g[e, i] rows[i] + normal[e, i] at[i]) to out (2, tiled, M), at in
    the first W columns.

    The samples i are the chosen (count,) of fours (., 4).
    """
    columns = rows.shape[1]
    W = at.shape[1]
    tile = weights.shape[1]
    step = BYTES_PER_BLOCK // rows.itemsize if 8 < W < 24 else 8
    for l in range(0, columns, step):
        for e in range(2):
            if l < W:
                _add_load(
                    rows,
                    columns,
                    l,
                    g[e],
                    fours,
                    chosen,
                    count,
                    weights,
                    tile,
                    out[e],
                    normal[e],
                    at,
                    W,
                )
            else:
                _add_motion(
                    rows,
                    columns,
                    l,
                    g[e],
                    fours,
                    chosen,
                    count,
                    weights,
                    tile,
                    out[e],
                    normal[e],
                    at,
                    W,
                )


@njit(**INNER_KERNEL)
def _add_load(rows, columns, l, g, fours, chosen, count, weights, tile, out, normal, at, W):
    """A block of columns to which the normal load matters."""
    if tile == 3:
        _load_two(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    elif tile == 7:
        _load_four(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    elif tile == 11:
        _load_six(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    elif tile == 15:
        _load_eight(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    else:
        _load_first_eight(
            rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W
        )
    for k in range(2 * HARMONICS_PER_TILE - 1, tile, 2 * HARMONICS_PER_TILE):
        _load_eight_more(
            rows, columns, l, g, fours, chosen, count, weights, tile, out, k, normal, at, W
        )


@njit(**INNER_KERNEL)
def _add_motion(rows, columns, l, g, fours, chosen, count, weights, tile, out, normal, at, W):
    """A block of columns of a tangent."""
    if tile == 3:
        _add_two(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    elif tile == 7:
        _add_four(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    elif tile == 11:
        _add_six(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    elif tile == 15:
        _add_eight(rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W)
    else:
        _add_first_eight(
            rows, columns, l, g, fours, chosen, count, weights, tile, out, 0, normal, at, W
        )
    for k in range(2 * HARMONICS_PER_TILE - 1, tile, 2 * HARMONICS_PER_TILE):
        _add_eight_more(
            rows, columns, l, g, fours, chosen, count, weights, tile, out, k, normal, at, W
        )
