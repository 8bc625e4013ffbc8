"""numpy's random streams for machine code: the bits of `default_rng(SeedSequence(seed).spawn(n))`.

A generator is a PCG64: s <- a s + c modulo 2^128, its output the xor of the halves of s rotated by
the top six bits. `SeedSequence` hashes a seed and the number of a stream to s and c. Normals come
from a ziggurat of 256 layers of equal area: one output picks a layer and a place in it, and 99 in
100 are below the curve for sure; the others ask the exponential.

These kernels compute in unsigned 64-bit numbers, which wrap; Python runs them too, slowly, where
numpy's warnings about that are off. They are a second `numpy.random` for the sake of speed: four
times as fast, without the interpreter's lock, and `agrees_with_numpy` says whether it is the same.
"""

from __future__ import annotations

import importlib.util
import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fullam.numbers.kernel import Number, kernel
from fullam.numbers.records import Rows

SEED_WORDS = 4
"""Words of 32 bits of the seeds that are covered: all below 2^128."""

U = np.uint64
LOW = U(0xFFFFFFFF)
ONE, HALF, SHIFT = U(1), U(32), U(16)
MULTIPLIER = U(2549297995355413924), U(4865540595714422341)
"""a of PCG64, its high and its low half."""

HASH_A, HASH_B = (U(0x43B0D7E5), U(0x931E8875)), (U(0x8B51F9DD), U(0x58F38DED))
"""First constant and multiplier of `SeedSequence`: of hashing entropy, of generating states."""
MIX_LEFT, MIX_RIGHT = U(0xCA01F9DD), U(0x4973F715)

TAIL, TAIL_RATE = 3.6541528853610088, 0.27366123732975828
"""Where the lowest layer ends and the tail of the normal distribution begins, and 1 over it."""
LAST_BITS = U(0x000FFFFFFFFFFFFF)
UNIT = 1.0 / 9007199254740992.0


class Seed(NamedTuple):
    """A seed in words of 32 bits, the lowest first."""

    a: Number
    b: Number
    c: Number
    d: Number


class Layer(NamedTuple):
    """A layer of the ziggurat.

    Width over 2^52, places that are below the curve for sure, and the curve at its edge.
    """

    width: Number
    limit: Number
    curve: Number


def seed_words(seed: int) -> Seed | None:
    """The words of a seed; None if it has more than `SEED_WORDS`."""
    if seed >> (32 * SEED_WORDS):
        return None
    return Seed(*(float(seed >> (32 * i) & 0xFFFFFFFF) for i in range(SEED_WORDS)))


@kernel
def hashed(value, constant, multiplier):
    """A word hashed, and the constant for the next one."""
    following = (constant * multiplier) & LOW
    value = ((value ^ constant) * following) & LOW
    return value ^ (value >> SHIFT), following


@kernel
def mixed(x, y, constant):
    """The word x with the hash of y mixed in, and the constant for the next one."""
    y, following = hashed(y, constant, HASH_A[1])
    value = (MIX_LEFT * x - MIX_RIGHT * y) & LOW
    return value ^ (value >> SHIFT), following


@kernel
def seeded_pool(seed, number):
    """Pool of four words of `SeedSequence(seed, spawn_key=(number,))`."""
    a, k = hashed(U(seed.a), HASH_A[0], HASH_A[1])
    b, k = hashed(U(seed.b), k, HASH_A[1])
    c, k = hashed(U(seed.c), k, HASH_A[1])
    d, k = hashed(U(seed.d), k, HASH_A[1])
    b, k = mixed(b, a, k)
    c, k = mixed(c, a, k)
    d, k = mixed(d, a, k)
    a, k = mixed(a, b, k)
    c, k = mixed(c, b, k)
    d, k = mixed(d, b, k)
    a, k = mixed(a, c, k)
    b, k = mixed(b, c, k)
    d, k = mixed(d, c, k)
    a, k = mixed(a, d, k)
    b, k = mixed(b, d, k)
    c, k = mixed(c, d, k)
    a, k = mixed(a, number, k)
    b, k = mixed(b, number, k)
    c, k = mixed(c, number, k)
    d, k = mixed(d, number, k)
    return a, b, c, d


@kernel
def joined(low, high, constant):
    """A number of two words of the pool, hashed, and the constant for the next one."""
    low, k = hashed(low, constant, HASH_B[1])
    high, k = hashed(high, k, HASH_B[1])
    return low | (high << HALF), k


@kernel
def high_product(x, y):
    """Upper half of the product of two 64-bit numbers."""
    x0, x1, y0, y1 = x & LOW, x >> HALF, y & LOW, y >> HALF
    middle = x1 * y0 + ((x0 * y0) >> HALF)
    other = x0 * y1 + (middle & LOW)
    return x1 * y1 + (middle >> HALF) + (other >> HALF)


@kernel
def advanced(high, low, more_high, more_low):
    """A s + c for a state s and an increment c, all in halves."""
    top = high_product(low, MULTIPLIER[1]) + high * MULTIPLIER[1] + low * MULTIPLIER[0]
    bottom = low * MULTIPLIER[1] + more_low
    return top + more_high + U(bottom < more_low), bottom


@kernel
def stream(seed, number):
    """State of the generator of a stream of a seed: s and c in halves, before its first output."""
    a, b, c, d = seeded_pool(seed, U(number))
    start_high, k = joined(a, b, HASH_B[0])
    start_low, k = joined(c, d, k)
    more_high, k = joined(a, b, k)
    more_low, k = joined(c, d, k)
    more_high = (more_high << ONE) | (more_low >> U(63))
    more_low = (more_low << ONE) | ONE
    low = start_low + more_low
    high = start_high + more_high + U(low < more_low)
    high, low = advanced(high, low, more_high, more_low)
    return high, low, more_high, more_low


@kernel
def next_word(state):
    """The generator advanced, and its output of 64 bits."""
    high, low = advanced(state[0], state[1], state[2], state[3])
    word, turn = high ^ low, high >> U(58)
    turned = (word >> turn) | (word << ((U(64) - turn) & U(63)))
    return (high, low, state[2], state[3]), turned


@kernel
def next_uniform(state):
    """The generator advanced, and a number in [0, 1)."""
    state, word = next_word(state)
    return state, np.int64(word >> U(11)) * UNIT


@kernel
def next_normal(state, layers):
    """The generator advanced, and a normal number."""
    while True:
        state, word = next_word(state)
        layer, place = np.int64(word & U(255)), np.int64((word >> U(9)) & LAST_BITS)
        x = place * layers[layer].width
        if word & U(256):
            x = -x
        if place < layers[layer].limit:
            return state, x
        state, x, inside = next_rare_normal(state, layers, layer, x)
        if inside:
            return state, -x if layer == 0 and (place >> 8) & 1 else x


@kernel
def next_rare_normal(state, layers, layer, x):
    """What becomes of a place that may be above the curve: a number, and whether it is taken.

    In the lowest layer the number is one of the tail, without its sign.
    """
    if layer == 0:
        while True:
            state, u = next_uniform(state)
            x = -TAIL_RATE * math.log1p(-u)
            state, u = next_uniform(state)
            y = -math.log1p(-u)
            if y + y > x * x:
                return state, TAIL + x, True
    state, u = next_uniform(state)
    outer = layers[layer].curve
    height = (layers[layer - 1].curve - outer) * u + outer
    return state, x, height < math.exp(-0.5 * x * x)


@kernel
def draw_normals(state, layers, numbers):
    """Draw normal numbers into a sequence, as `Generator.standard_normal` does."""
    for i in range(len(numbers)):
        state, x = next_normal(state, layers)
        numbers[i] = x
    return state


@cache
def ziggurat() -> Rows | None:
    """Numpy's table of layers, as `Layer` rows; None if it is not found, or yields other numbers.

    The table is numba's copy, read from its file alone: importing numba takes half a second, and
    what is compiled already does without.
    """
    numba = importlib.util.find_spec("numba")
    if numba is None or numba.origin is None:
        return None
    place = Path(numba.origin).parent / "np" / "random" / "_constants.py"
    spec = importlib.util.spec_from_file_location("fullam_ziggurat", place)
    if spec is None or spec.loader is None or not place.is_file():
        return None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    return Rows(Layer, np.stack([tables.wi_double, tables.ki_double, tables.fi_double], axis=1))
