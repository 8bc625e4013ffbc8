"""Lanes: a number that is the numbers of several flights, one in each lane of a vector register.

`Lanes(8)` is a numba type whose machine form is LLVM's <8 x double>. It lives inside machine code
only, where `compiled_records` loads and stores it; kernels meet it as they meet a float.
Comparisons give a `Mask`, which `select` takes. A float next to lanes is the same float in every
lane. Arithmetic carries no fast-math flag, so each lane has the bits that Python floats would have.

This file and `compiled_records` are all that knows numba from the inside. Beyond its public
extension API they use `Type.unify`, `can_convert_from`, `Conversion`, `BaseTuple.from_types`,
`cgutils` and `context.make_tuple`; a test of lanes against floats says so if an upgrade breaks it.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.extending import (
    lower_builtin,
    lower_cast,
    models,
    overload,
    register_model,
    type_callable,
)

from fullam.numbers import elementary, kernel

DOUBLE, INDEX = ir.DoubleType(), ir.IntType(32)


class _Vector(types.Type):
    """A numba type that is known by its width, and that scalars become where the two meet."""

    scalars: type[types.Type]

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(f"{type(self).__name__}({width})")

    @property
    def key(self) -> int:
        return self.width

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """A scalar becomes lanes as an operand, or where a loop's variable first held a scalar."""
        return Conversion.safe if isinstance(other, self.scalars) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """What a variable is that holds lanes here and a scalar there: lanes."""
        return self if isinstance(other, self.scalars) else None


class Lanes(_Vector):
    """The numba type of a number of `width` flights."""

    scalars = types.Number


class Mask(_Vector):
    """The numba type of a condition of `width` flights."""

    scalars = types.Boolean


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(DOUBLE, fe_type.width))


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(ir.IntType(1), fe_type.width))


def splat(builder: Any, scalar: Any, width: int) -> Any:
    """The LLVM vector with a scalar in every lane."""
    vector = ir.Constant(ir.VectorType(scalar.type, width), ir.Undefined)
    first = builder.insert_element(vector, scalar, ir.Constant(INDEX, 0))
    zeros = ir.Constant(ir.VectorType(INDEX, width), [0] * width)
    return builder.shuffle_vector(first, vector, zeros)


@lower_cast(types.Number, Lanes)
def _number_to_lanes(context, builder, fromty, toty, value):
    return splat(builder, context.cast(builder, value, fromty, types.float64), toty.width)


@lower_cast(types.Boolean, Mask)
def _boolean_to_mask(context, builder, fromty, toty, value):
    return splat(builder, value, toty.width)


def _common(*kinds: Any) -> Any:
    """The lanes that some operands amount to; None if there are none, or anything else beside."""
    lanes = {kind for kind in kinds if isinstance(kind, Lanes)}
    fit = all(isinstance(kind, Lanes | types.Number) for kind in kinds)
    return lanes.pop() if fit and len(lanes) == 1 else None


def _same(lanes: Lanes) -> Lanes:
    return lanes


def _mask(lanes: Lanes) -> Mask:
    return Mask(lanes.width)


def _binary(function: Any, result: Callable[[Any], Any], build: Callable[..., Any]) -> None:
    """Give an operator of two numbers its meaning for lanes."""

    @type_callable(function)
    def typing(context):
        def typer(a, b):
            lanes = _common(a, b)
            return None if lanes is None else result(lanes)(lanes, lanes)

        return typer

    @lower_builtin(function, Lanes, Lanes)
    def lowering(context, builder, signature, values):
        return build(builder, *values)


def _unary(function: Any, build: Callable[..., Any]) -> None:
    """Give a function of one number its meaning for lanes."""

    @type_callable(function)
    def typing(context):
        return lambda a: a if isinstance(a, Lanes) else None

    @lower_builtin(function, Lanes)
    def lowering(context, builder, signature, values):
        return build(builder, values[0])


for _operator, _name in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    _binary(getattr(operator, _operator), _same, getattr(ir.IRBuilder, _name))
for _operator, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
    _binary(getattr(operator, _operator), _mask, lambda b, x, y, s=_sign: b.fcmp_ordered(s, x, y))
_unary(operator.neg, ir.IRBuilder.fneg)


def _llvm_sqrt(builder: Any, x: Any) -> Any:
    kind = f"v{x.type.count}f64" if isinstance(x.type, ir.VectorType) else "f64"
    signature = ir.FunctionType(x.type, [x.type])
    # llvmlite cannot name vector intrinsics by itself: it is given the type.
    return builder.call(builder.module.declare_intrinsic(f"llvm.sqrt.{kind}", fnty=signature), [x])


_unary(kernel.sqrt, _llvm_sqrt)


@type_callable(kernel.sqrt)
def _type_sqrt(context):
    return lambda a: types.float64(types.float64) if isinstance(a, types.Number) else None


@lower_builtin(kernel.sqrt, types.Float)
def _lower_sqrt(context, builder, signature, values):
    return _llvm_sqrt(builder, values[0])


@overload(elementary.sincos)
def _sincos(x):
    return lambda x: elementary.sincos_series(x)


@overload(elementary.arctan2)
def _arctan2(y, x):
    return lambda y, x: elementary.arctan2_series(y, x)


def _selected(condition: Any, a: Any, b: Any) -> Any:
    """Type of what `select` takes from two numbers or two records of them; None if it cannot."""
    if isinstance(a, types.BaseTuple) and isinstance(b, types.BaseTuple) and len(a) == len(b):
        parts = [_selected(condition, x, y) for x, y in zip(a, b, strict=True)]
        if None in parts:
            return None
        return types.BaseTuple.from_types(parts, getattr(a, "instance_class", None))
    if isinstance(condition, types.Boolean):
        numbers = isinstance(a, types.Number) and isinstance(b, types.Number)
        return types.float64 if numbers else _common(a, b)
    if isinstance(condition, Mask):
        numbers = all(isinstance(kind, types.Number | Lanes) for kind in (a, b))
        return Lanes(condition.width) if numbers else None
    return None


@type_callable(kernel.select)
def _type_select(context):
    def typer(condition, a, b):
        result = _selected(condition, a, b)
        return None if result is None else result(condition, a, b)

    return typer


@lower_builtin(kernel.select, types.Boolean, types.Any, types.Any)
@lower_builtin(kernel.select, Mask, types.Any, types.Any)
def _lower_select(context, builder, signature, values):
    condition = values[0]

    def choose(result, a, x, b, y):
        if not isinstance(result, types.BaseTuple):
            x, y = context.cast(builder, x, a, result), context.cast(builder, y, b, result)
            return builder.select(condition, x, y)
        unpacked = cgutils.unpack_tuple(builder, x), cgutils.unpack_tuple(builder, y)
        parts = zip(result, a, unpacked[0], b, unpacked[1], strict=True)
        return context.make_tuple(builder, result, [choose(*part) for part in parts])

    _, a, b = signature.args
    return choose(signature.return_type, a, values[1], b, values[2])


def _logical(function: Any, build: Callable[..., Any]) -> None:
    """Give a function of two conditions its meaning."""

    @type_callable(function)
    def typing(context):
        def typer(a, b):
            if not all(isinstance(kind, types.Boolean | Mask) for kind in (a, b)):
                return None
            kind = a if isinstance(a, Mask) else b
            return kind(kind, kind)

        return typer

    @lower_builtin(function, types.Boolean, types.Boolean)
    @lower_builtin(function, Mask, Mask)
    def lowering(context, builder, signature, values):
        return build(builder, *values)


_logical(kernel.both, ir.IRBuilder.and_)
_logical(kernel.either, ir.IRBuilder.or_)


@type_callable(kernel.some)
def _type_some(context):
    return lambda a: types.boolean if isinstance(a, types.Boolean | Mask) else None


@lower_builtin(kernel.some, types.Boolean)
def _lower_some(context, builder, signature, values):
    return values[0]


@lower_builtin(kernel.some, Mask)
def _lower_some_lanes(context, builder, signature, values):
    bits = builder.bitcast(values[0], ir.IntType(signature.args[0].width))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


@overload(kernel.lane_count)
def _lane_count(condition):
    width = condition.width if isinstance(condition, Mask) else 1
    return lambda condition: width


@type_callable(kernel.lane_of)
def _type_lane_of(context):
    def typer(condition, lane):
        fits = isinstance(condition, types.Boolean | Mask) and isinstance(lane, types.Integer)
        return types.boolean(condition, types.intp) if fits else None

    return typer


@lower_builtin(kernel.lane_of, types.Boolean, types.Integer)
def _lower_lane_of(context, builder, signature, values):
    return values[0]


@lower_builtin(kernel.lane_of, Mask, types.Integer)
def _lower_lane_of_lanes(context, builder, signature, values):
    return builder.extract_element(values[0], values[1])
