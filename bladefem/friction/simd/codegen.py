"""Numbers in the lanes of a vector: how kernels are written whose loops do not become vectors by
themselves.

Numba turns a loop into vectors only where it is long, writes one array and needs no sum to stay in
registers. The functions of time_kernels.py are written for blocks of 64 bytes instead; any
processor runs them, with as many instructions a block as its vectors ask for. A block has the
precision of the array it comes from, and takes that of the array it goes to, so that one text
serves arrays of 8 and of 4 bytes a number.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from bladefem.util.numba_options import KERNEL

# bytes of a block; numbers of 8 bytes in it
BYTES_PER_BLOCK = 64
LANES_PER_VECTOR = 8
INT64 = ir.IntType(64)
INT32 = ir.IntType(32)
# a product and a sum may be rounded once
FUSED_FLAGS = ("contract",)


class Lanes:
    """A block of numbers; + - * / with another block or a constant."""

    def __init__(
        self,
        builder: ir.IRBuilder,
        value: ir.Value,
    ) -> None:
        self.builder = builder
        self.value = value

    def _with(
        self,
        name: str,
        other: Lanes | float,
        swapped: bool = False,
    ) -> Lanes:
        pair = (self._value(other), self.value) if swapped else (self.value, self._value(other))
        return Lanes(self.builder, getattr(self.builder, name)(*pair, flags=FUSED_FLAGS))

    def _value(self, other: Lanes | float) -> ir.Value:
        block = self.value.type
        return (
            other.value
            if isinstance(other, Lanes)
            else ir.Constant(block, [float(other)] * block.count)
        )

    def __add__(self, other: Lanes | float) -> Lanes:
        return self._with("fadd", other)

    def __sub__(self, other: Lanes | float) -> Lanes:
        return self._with("fsub", other)

    def __rsub__(self, other: float) -> Lanes:
        return self._with("fsub", other, True)

    def __mul__(self, other: Lanes | float) -> Lanes:
        return self._with("fmul", other)

    def __truediv__(self, other: Lanes | float) -> Lanes:
        return self._with("fdiv", other)

    def __rtruediv__(self, other: float) -> Lanes:
        return self._with("fdiv", other, True)

    __radd__ = __add__
    __rmul__ = __mul__

    def sqrt(self) -> Lanes:
        """Root."""
        block = self.value.type
        root = cgutils.get_or_insert_function(
            self.builder.module,
            ir.FunctionType(block, [block]),
            f"llvm.sqrt.v{block.count}{block.element.intrinsic_name}",
        )
        return Lanes(self.builder, self.builder.call(root, [self.value]))

    def above(
        self,
        other: Lanes | float,
        yes: Lanes,
        no: Lanes,
    ) -> Lanes:
        """yes where this block is larger, no elsewhere."""
        return Lanes(self.builder, self.builder.select(self.over(other), yes.value, no.value))

    def over(self, other: Lanes | float) -> ir.Value:
        """Bits, set where this block is larger."""
        return self.builder.fcmp_ordered(">", self.value, self._value(other))


class Code:
    """Loads, stores, sums and loops of a kernel; arrays are addressed flat, by products and sums of
    whole numbers.
    """

    def __init__(
        self,
        builder: ir.IRBuilder,
        size: int = BYTES_PER_BLOCK,
    ) -> None:
        self.builder = builder
        self.size = size

    def half(self) -> Code:
        """The same for blocks of half the size."""
        return Code(self.builder, self.size // 2)

    def eight(self, array: ir.Value) -> Code:
        """The same for blocks of eight of an array's numbers."""
        return Code(self.builder, LANES_PER_VECTOR * _bytes(array.type.pointee))

    def lanes(self, array: ir.Value) -> int:
        """How many of an array's numbers are a block."""
        return self._type(array.type.pointee).count

    def _type(self, number: ir.Type) -> ir.VectorType:
        return ir.VectorType(number, self.size // _bytes(number))

    def each(self, numbers: ir.Value) -> list[ir.Value]:
        """The numbers of a tuple."""
        return cgutils.unpack_tuple(self.builder, numbers)

    def whole(self, number: ir.Value | int) -> ir.Value:
        """A whole number."""
        return INT64(number) if isinstance(number, int) else number

    def place(self, *terms: ir.Value | int | tuple) -> ir.Value:
        """Sum of whole numbers, and of the products of pairs."""
        total = INT64(0)
        for term in terms:
            if isinstance(term, tuple):
                term = self.builder.mul(*map(self.whole, term))
            total = self.builder.add(total, self.whole(term))
        return total

    def _block(
        self,
        array: ir.Value,
        count: int,
        terms: tuple,
    ) -> ir.Value:
        place = self.builder.gep(array, [self.place(*terms)])
        return self.builder.bitcast(place, ir.VectorType(array.type.pointee, count).as_pointer())

    def load(self, array: ir.Value, *terms: ir.Value | int | tuple) -> Lanes:
        """The numbers from a place on."""
        return Lanes(
            self.builder, self.builder.load(self._block(array, self.lanes(array), terms), align=4)
        )

    def fit(
        self,
        block: Lanes,
        array: ir.Value,
    ) -> Lanes:
        """A block in an array's precision."""
        return Lanes(self.builder, self._fit(block.value, array.type.pointee))

    def store(self, block: Lanes, array: ir.Value, *terms: ir.Value | int | tuple) -> None:
        """Numbers to a place on."""
        value = self._fit(block.value, array.type.pointee)
        self.builder.store(value, self._block(array, value.type.count, terms), align=4)

    def store_first(
        self, count: ir.Value, block: Lanes, array: ir.Value, *terms: ir.Value | int | tuple
    ) -> None:
        """Of a block the numbers before the place count, to a place on."""
        value = self._fit(block.value, array.type.pointee)
        spot = self._block(array, value.type.count, terms)
        lanes = value.type.count
        steps = ir.Constant(ir.VectorType(INT64, lanes), list(range(lanes)))
        inside = self.builder.icmp_signed("<", steps, self._spread(count, lanes))
        kind = f"v{lanes}{value.type.element.intrinsic_name}"
        name = f"llvm.masked.store.{kind}.p0{kind}"
        function = ir.FunctionType(ir.VoidType(), [value.type, spot.type, INT32, inside.type])
        self.builder.call(
            cgutils.get_or_insert_function(self.builder.module, function, name),
            [value, spot, INT32(4), inside],
        )

    def _fit(
        self,
        value: ir.Value,
        number: ir.Type,
    ) -> ir.Value:
        """A block or number in another precision."""
        block = isinstance(value.type, ir.VectorType)
        fit = ir.VectorType(number, value.type.count) if block else number
        if value.type == fit:
            return value
        return (self.builder.fpext if isinstance(number, ir.DoubleType) else self.builder.fptrunc)(
            value, fit
        )

    def one(self, array: ir.Value, *terms: ir.Value | int | tuple) -> ir.Value:
        """The number at a place."""
        return self.builder.load(self.builder.gep(array, [self.place(*terms)]))

    def spread(
        self,
        number: ir.Value,
        array: ir.Value | None = None,
    ) -> Lanes:
        """A number in all lanes, in the precision of an array if one is given."""
        number = number if array is None else self._fit(number, array.type.pointee)
        return Lanes(self.builder, self._spread(number, self._type(number.type).count))

    def _spread(
        self,
        number: ir.Value,
        count: int,
    ) -> ir.Value:
        undefined = ir.Constant(ir.VectorType(number.type, count), ir.Undefined)
        first = self.builder.insert_element(undefined, number, INT32(0))
        return self.builder.shuffle_vector(
            first, undefined, ir.Constant(ir.VectorType(INT32, count), None)
        )

    def zeros(self, array: ir.Value) -> Lanes:
        """Zeros in an array's precision."""
        return Lanes(self.builder, ir.Constant(self._type(array.type.pointee), None))

    def variable(self, start: Lanes) -> ir.Value:
        """A block that changes; it lives in a register."""
        spot = cgutils.alloca_once(self.builder, start.value.type)
        self.builder.store(start.value, spot)
        return spot

    def get(self, variable: ir.Value) -> Lanes:
        """A variable's block."""
        return Lanes(self.builder, self.builder.load(variable))

    def set(
        self,
        variable: ir.Value,
        block: Lanes,
    ) -> None:
        """Change a variable."""
        self.builder.store(block.value, variable)

    def search(
        self,
        begin: ir.Value,
        end: ir.Value,
        over: Callable[[ir.Value], ir.Value],
    ) -> ir.Value:
        """First place from begin on where a bit of over(place) is set, the bits of a block from
        there on; or end.
        """
        builder = self.builder
        spot = cgutils.alloca_once_value(self.builder, begin)
        head, body, found, done = (
            builder.append_basic_block(name) for name in ("head", "body", "found", "done")
        )
        builder.branch(head)
        builder.position_at_end(head)
        i = builder.load(spot)
        builder.cbranch(builder.icmp_signed("<", i, end), body, done)
        builder.position_at_end(body)
        bits = over(i)
        bits = builder.bitcast(bits, ir.IntType(bits.type.count))
        builder.store(builder.add(i, self.whole(LANES_PER_VECTOR)), spot)
        builder.cbranch(builder.icmp_unsigned("!=", bits, bits.type(0)), found, head)
        builder.position_at_end(found)
        builder.store(
            builder.add(i, builder.cttz(builder.zext(bits, INT64), ir.IntType(1)(1))), spot
        )
        builder.branch(done)
        builder.position_at_end(done)
        last = builder.load(spot)
        return builder.select(builder.icmp_signed("<", last, end), last, end)

    def loop(
        self,
        begin: ir.Value | int,
        end: ir.Value,
        step: int = 1,
    ):
        """``with code.loop(begin, end, step) as i``."""
        return _Loop(self.builder, self.whole(begin), end, INT64(step))


def _bytes(number: ir.Type) -> int:
    return 8 if isinstance(number, ir.DoubleType) else 4


class _Loop:
    def __init__(
        self,
        builder: ir.IRBuilder,
        begin: ir.Value,
        end: ir.Value,
        step: ir.Value,
    ) -> None:
        self.context = cgutils.for_range_slice(builder, begin, end, step, INT64)

    def __enter__(self) -> ir.Value:
        return self.context.__enter__()[0]

    def __exit__(self, *error: object) -> None:
        self.context.__exit__(*error)


@njit(**KERNEL)
def zeros(size, dtype):
    """Zeros (size,) that begin where a block does in memory, so that no load of a block crosses a
    line of the cache.
    """
    room = np.zeros(size + BYTES_PER_BLOCK, dtype)
    first = -room.ctypes.data % BYTES_PER_BLOCK // room.itemsize
    return room[first : first + size]


def kernel(write: Callable) -> Callable:
    """What compiled code may call as the function that write(code, *arguments) writes: contiguous
    arrays, numbers.

    If write is said to return something, it is a whole number.
    """
    result = types.int64 if signature(write).return_annotation == "int" else types.void

    def typed(context, *given):
        def generate(target, builder, call, values):
            flat = [
                target.make_array(t)(target, builder, v).data if isinstance(t, types.Array) else v
                for t, v in zip(call.args, values, strict=True)
            ]
            return write(Code(builder), *flat) or target.get_dummy_value()

        kept = types.Array | types.Float | types.BaseTuple
        return result(*[t if isinstance(t, kept) else types.int64 for t in given]), generate

    # the names of the arguments, which Numba counts
    described: Any = typed
    described.__signature__ = signature(write)
    return intrinsic(described)
