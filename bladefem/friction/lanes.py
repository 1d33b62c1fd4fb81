"""Numbers in the lanes of a vector: how kernels are written whose loops do not become vectors by themselves.

Numba turns a loop into vectors only where it is long, writes one array and needs no sum to stay in registers. The
functions of lane_kernels.py are written for blocks of 64 bytes instead; any processor runs them, with as many
instructions a block as its vectors ask for. A block has the precision of the array it comes from, and takes that of the
array it goes to, so that one text serves arrays of 8 and of 4 bytes a number.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

__all__ = ["BLOCK", "LANES", "Code", "Lanes", "kernel"]

BLOCK, LANES = 64, 8        # bytes of a block; numbers of 8 bytes in it
WHOLE, HALF = ir.IntType(64), ir.IntType(32)
FUSED = ("contract",)       # a product and a sum may be rounded once


class Lanes:
    """A block of numbers; + - * / with another block or a constant."""

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def _with(self, name: str, other: Lanes | float, swapped: bool = False) -> Lanes:
        pair = (self._value(other), self.value) if swapped else (self.value, self._value(other))
        return Lanes(self.builder, getattr(self.builder, name)(*pair, flags=FUSED))

    def _value(self, other: Lanes | float) -> ir.Value:
        block = self.value.type
        return other.value if isinstance(other, Lanes) else ir.Constant(block, [float(other)] * block.count)

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

    __radd__, __rmul__ = __add__, __mul__

    def sqrt(self) -> Lanes:
        """Root."""
        block = self.value.type
        root = cgutils.get_or_insert_function(self.builder.module, ir.FunctionType(block, [block]),
                                              f"llvm.sqrt.v{block.count}{block.element.intrinsic_name}")
        return Lanes(self.builder, self.builder.call(root, [self.value]))

    def above(self, other: Lanes | float, yes: Lanes, no: Lanes) -> Lanes:
        """yes where this block is larger, no elsewhere."""
        larger = self.builder.fcmp_ordered(">", self.value, self._value(other))
        return Lanes(self.builder, self.builder.select(larger, yes.value, no.value))


class Code:
    """Loads, stores, sums and loops of a kernel; arrays are addressed flat, by products and sums of whole numbers."""

    def __init__(self, builder: ir.IRBuilder, size: int = BLOCK) -> None:
        self.builder, self.size = builder, size

    def half(self) -> Code:
        """The same for blocks of half the size."""
        return Code(self.builder, self.size // 2)

    def lanes(self, array: ir.Value) -> int:
        """How many of an array's numbers are a block."""
        return self._type(array.type.pointee).count

    def _type(self, number: ir.Type) -> ir.VectorType:
        return ir.VectorType(number, self.size // (8 if isinstance(number, ir.DoubleType) else 4))

    def whole(self, number: ir.Value | int) -> ir.Value:
        """A whole number."""
        return WHOLE(number) if isinstance(number, int) else number

    def place(self, *terms: ir.Value | int | tuple) -> ir.Value:
        """Sum of whole numbers, and of the products of pairs."""
        total = WHOLE(0)
        for term in terms:
            if isinstance(term, tuple):
                term = self.builder.mul(*map(self.whole, term))
            total = self.builder.add(total, self.whole(term))
        return total

    def _block(self, array: ir.Value, count: int, terms: tuple) -> ir.Value:
        place = self.builder.gep(array, [self.place(*terms)])
        return self.builder.bitcast(place, ir.VectorType(array.type.pointee, count).as_pointer())

    def load(self, array: ir.Value, *terms: ir.Value | int | tuple) -> Lanes:
        """The numbers from a place on."""
        return Lanes(self.builder, self.builder.load(self._block(array, self.lanes(array), terms), align=4))

    def store(self, block: Lanes, array: ir.Value, *terms: ir.Value | int | tuple) -> None:
        """Numbers to a place on."""
        value, spot = block.value, self._block(array, block.value.type.count, terms)
        if value.type.element != array.type.pointee:
            shorter = isinstance(value.type.element, ir.DoubleType)
            value = (self.builder.fptrunc if shorter else self.builder.fpext)(value, spot.type.pointee)
        self.builder.store(value, spot, align=4)

    def one(self, array: ir.Value, *terms: ir.Value | int | tuple) -> ir.Value:
        """The number at a place."""
        return self.builder.load(self.builder.gep(array, [self.place(*terms)]))

    def spread(self, number: ir.Value) -> Lanes:
        """A number in all lanes."""
        undefined = ir.Constant(self._type(number.type), ir.Undefined)
        first = self.builder.insert_element(undefined, number, HALF(0))
        zeros = ir.Constant(ir.VectorType(HALF, undefined.type.count), None)
        return Lanes(self.builder, self.builder.shuffle_vector(first, undefined, zeros))

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

    def set(self, variable: ir.Value, block: Lanes) -> None:
        """Change a variable."""
        self.builder.store(block.value, variable)

    def loop(self, begin: ir.Value | int, end: ir.Value, step: int = 1):
        """``with code.loop(begin, end, step) as i``."""
        return _Loop(self.builder, self.whole(begin), end, WHOLE(step))


class _Loop:
    def __init__(self, builder: ir.IRBuilder, begin: ir.Value, end: ir.Value, step: ir.Value) -> None:
        self.context = cgutils.for_range_slice(builder, begin, end, step, WHOLE)

    def __enter__(self) -> ir.Value:
        return self.context.__enter__()[0]

    def __exit__(self, *error: object) -> None:
        self.context.__exit__(*error)


def kernel(write: Callable) -> Callable:
    """What compiled code may call as the function that write(code, *arguments) writes: contiguous arrays, numbers."""
    def typed(context, *given):
        def generate(target, builder, call, values):
            flat = [target.make_array(t)(target, builder, v).data if isinstance(t, types.Array) else v
                    for t, v in zip(call.args, values, strict=True)]
            write(Code(builder), *flat)
            return target.get_dummy_value()
        return types.void(*[t if isinstance(t, types.Array | types.Float) else types.int64 for t in given]), generate

    typed.__signature__ = signature(write)      # the names of the arguments, which Numba counts
    return intrinsic(typed)
