"""`Rows` as machine code sees them: a pointer to doubles and lengths, indexed to records.

They are taken from a *table* of 64-bit numbers, address and lengths of one `Rows` after the other,
which costs a load each and no look at a Python object. Unlike arrays they cost nothing to pass, to
slice (`arm[k][i]`) or to keep in a tuple. Indices are not checked and do not count from the end.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import (
    intrinsic,
    lower_builtin,
    models,
    overload,
    register_model,
    type_callable,
)

from fullam.numbers.lanes import DOUBLE, Lanes
from fullam.numbers.records import ALIGNMENT, Rows, layout, one, size

POINTER = types.CPointer(types.float64)
WORD = ir.IntType(64)


class RowsType(types.Type):
    """The numba type of `Rows`.

    Attributes:
        record: Class of the records.
        lanes: Lanes of each number, 0 for scalars.
        stride: Doubles from one number to the next: the lanes of the array that holds them.
        depth: How many indices lead to a record.
    """

    def __init__(self, record: Any, lanes: int, stride: int, depth: int) -> None:
        """Name it after all that it is."""
        self.record, self.lanes, self.stride, self.depth = record, lanes, stride, depth
        self.number = Lanes(lanes) if lanes else types.float64
        super().__init__(f"Rows({record}, {lanes}, {stride}, {depth})")

    @property
    def key(self) -> Any:
        """What makes two of these types the same."""
        return self.record, self.lanes, self.stride, self.depth

    @property
    def element(self) -> Any:
        """Type of what an index gives."""
        if self.depth > 1:
            return RowsType(self.record, self.lanes, self.stride, self.depth - 1)
        return self._typed(layout(self.record))

    def _typed(self, plan: Any) -> Any:
        if plan is None:
            return self.number
        parts = [self._typed(part) for part in plan[1:]]
        return types.BaseTuple.from_types(parts, None if plan[0] is tuple else plan[0])

    def fits(self, value: Any, plan: Any = ()) -> bool:
        """Whether a value of that type can be stored; floats go where lanes are."""
        plan = layout(self.record) if plan == () else plan
        if plan is None:
            return value == self.number or isinstance(value, types.Number)
        parts = plan[1:]
        return (
            isinstance(value, types.BaseTuple)
            and len(value) == len(parts)
            and all(map(self.fits, value, parts))
        )


@register_model(RowsType)
class _RowsModel(models.StructModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        lengths = types.UniTuple(types.intp, fe_type.depth)
        super().__init__(dmm, fe_type, [("data", POINTER), ("lengths", lengths)])


def type_of(view: Any) -> Any:
    """The numba type of a view: a NamedTuple of `RowsType`."""
    if isinstance(view, Rows):
        return RowsType(view.record, view.lanes, view.lanes or 1, view.depth)
    return types.BaseTuple.from_types([type_of(part) for part in view], type(view))


def viewer(kind: Any) -> Any:
    """A function for machine code: from the address of a table to the view that it describes."""

    @intrinsic
    def look(typingctx, address):
        def build(context, builder, signature, values):
            table = builder.inttoptr(values[0], WORD.as_pointer())
            position = 0

            def word():
                nonlocal position
                place = builder.gep(table, [ir.Constant(WORD, position)])
                position += 1
                return builder.load(place)

            def make(kind):
                if isinstance(kind, types.BaseTuple):
                    return context.make_tuple(builder, kind, [make(part) for part in kind])
                rows = cgutils.create_struct_proxy(kind)(context, builder)
                rows.data = builder.inttoptr(word(), DOUBLE.as_pointer())
                shape = types.UniTuple(types.intp, kind.depth)
                lengths = [word() for _ in range(kind.depth)]
                rows.lengths = context.make_tuple(builder, shape, lengths)
                return rows._getvalue()

            return make(kind)

        return kind(types.intp), build

    return look


@intrinsic
def word(typingctx, address, index):
    """The 64-bit number that stands `index` numbers behind an address."""

    def build(context, builder, signature, values):
        table = builder.inttoptr(values[0], WORD.as_pointer())
        return builder.load(builder.gep(table, [values[1]]))

    return types.intp(types.intp, types.intp), build


@intrinsic
def call(typingctx, function, table, period):
    """Call the machine code at an address as f(table, period)."""

    def build(context, builder, signature, values):
        kind = ir.FunctionType(ir.VoidType(), [WORD, WORD])
        function = builder.inttoptr(values[0], kind.as_pointer())
        builder.call(function, [values[1], values[2]])
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.intp), build


@overload(len)
def _len(rows):
    if isinstance(rows, RowsType):
        return lambda rows: _length(rows)
    return None


def _length(rows):
    """Length of rows along their first index."""


@type_callable(_length)
def _type_length(context):
    return lambda rows: types.intp


@lower_builtin(_length, RowsType)
def _lower_length(context, builder, signature, values):
    rows = cgutils.create_struct_proxy(signature.args[0])(context, builder, values[0])
    return builder.extract_value(rows.lengths, 0)


@type_callable(operator.getitem)
def _type_getitem(context):
    def typer(rows, index):
        if isinstance(rows, RowsType) and isinstance(index, types.Integer):
            return rows.element(rows, types.intp)
        return None

    return typer


def _locate(context: Any, builder: Any, typ: Any, value: Any, index: Any) -> tuple[Any, list[Any]]:
    """Pointer to what an index gives, and the lengths that remain."""
    rows = cgutils.create_struct_proxy(typ)(context, builder, value)
    _, *lengths = cgutils.unpack_tuple(builder, rows.lengths)
    offset = builder.mul(index, ir.Constant(index.type, size(typ.record) * typ.stride))
    for length in lengths:
        offset = builder.mul(offset, length)
    return builder.gep(rows.data, [offset]), lengths


class _Cursor:
    """Walks over the numbers of a record, in order."""

    def __init__(self, builder: Any, pointer: Any, typ: Any) -> None:
        self.builder, self.pointer, self.typ, self.entry = builder, pointer, typ, 0

    def next(self) -> tuple[Any, int]:
        """Pointer to the next number, and its alignment."""
        builder, typ = self.builder, self.typ
        place = builder.gep(self.pointer, [ir.Constant(WORD, self.entry * typ.stride)])
        self.entry += 1
        kind = ir.VectorType(DOUBLE, typ.lanes) if typ.lanes else DOUBLE
        # The largest power of two that all numbers are a multiple of, up to the arrays' own.
        whole = (typ.lanes & -typ.lanes) or 1
        return builder.bitcast(place, kind.as_pointer()), min(8 * whole, ALIGNMENT)


@lower_builtin(operator.getitem, RowsType, types.Integer)
def _lower_getitem(context, builder, signature, values):
    typ, element = signature.args[0], signature.return_type
    pointer, lengths = _locate(context, builder, typ, *values)
    if typ.depth > 1:
        part = cgutils.create_struct_proxy(element)(context, builder)
        part.data = pointer
        kind = types.UniTuple(types.intp, len(lengths))
        part.lengths = context.make_tuple(builder, kind, lengths)
        return part._getvalue()
    cursor = _Cursor(builder, pointer, typ)

    def load(kind):
        if isinstance(kind, types.BaseTuple):
            return context.make_tuple(builder, kind, [load(part) for part in kind])
        place, alignment = cursor.next()
        return builder.load(place, align=alignment)

    return load(element)


@type_callable(operator.setitem)
def _type_setitem(context):
    def typer(rows, index, value):
        fits = isinstance(rows, RowsType) and rows.depth == 1 and rows.fits(value)
        return types.none(rows, types.intp, value) if fits else None

    return typer


@lower_builtin(operator.setitem, RowsType, types.Integer, types.Any)
def _lower_setitem(context, builder, signature, values):
    typ, _, kind = signature.args
    pointer, _ = _locate(context, builder, typ, values[0], values[1])
    cursor = _Cursor(builder, pointer, typ)

    def store(kind, value):
        if isinstance(kind, types.BaseTuple):
            for part, item in zip(kind, cgutils.unpack_tuple(builder, value), strict=True):
                store(part, item)
            return
        place, alignment = cursor.next()
        builder.store(context.cast(builder, value, kind, typ.number), place, align=alignment)

    store(kind, values[2])
    return context.get_dummy_value()


@type_callable(one)
def _type_one(context):
    def typer(rows, lane):
        if isinstance(rows, RowsType) and isinstance(lane, types.Integer):
            return RowsType(rows.record, 0, rows.stride, rows.depth)(rows, types.intp)
        return None

    return typer


@lower_builtin(one, RowsType, types.Integer)
def _lower_one(context, builder, signature, values):
    rows = cgutils.create_struct_proxy(signature.args[0])(context, builder, values[0])
    scalar = cgutils.create_struct_proxy(signature.return_type)(context, builder)
    scalar.data, scalar.lengths = builder.gep(rows.data, [values[1]]), rows.lengths
    return scalar._getvalue()
