"""Random streams of kernels: the bits of numpy's generators, by Python and by machine code."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from fullam.numbers import random_streams as streams
from fullam.numbers.kernel import kernel
from fullam.numbers.program import Stage, program
from fullam.numbers.records import Rows

SEEDS = [0, 1, 2**32 - 1, 2**32, 2**40 + 9, 2**96 + 2**33, 2**128 - 1]


def generator(seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(4)[number])


@pytest.fixture
def wrapping():
    """Unsigned numbers wrap in machine code; numpy's scalars warn of it."""
    with np.errstate(over="ignore"):
        yield


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stream_starts_where_numpys_does(seed, wrapping):
    for number in range(4):
        state = streams.stream(streams.seed_words(seed), number)
        high, low, more_high, more_low = map(int, state)
        expected = generator(seed, number).bit_generator.state["state"]
        assert (high << 64 | low, more_high << 64 | more_low) == (
            expected["state"],
            expected["inc"],
        )


def test_uniform_numbers_are_numpys(wrapping):
    state, drawn = streams.stream(streams.seed_words(5), 2), []
    for _ in range(200):
        state, u = streams.next_uniform(state)
        drawn.append(u)
    np.testing.assert_array_equal(drawn, generator(5, 2).random(200))


def test_the_upper_half_of_a_product(wrapping):
    for x, y in np.random.default_rng(0).integers(0, 2**64, (100, 2), dtype=np.uint64):
        assert int(streams.high_product(x, y)) == int(x) * int(y) >> 64


def test_longer_seeds_are_left_to_numpy():
    assert streams.seed_words(2**128) is None
    assert streams.seed_words(2**32 + 7) == (7.0, 1.0, 0.0, 0.0)


class View(NamedTuple):
    seeds: Any
    layers: Any
    numbers: Any


@kernel
def draw(view, k):
    streams.draw_normals(streams.stream(view.seeds[k], 1), view.layers, view.numbers)


@pytest.mark.parametrize(("compiled", "count"), [(True, 200_000), (False, 1000)])
def test_normal_numbers_are_numpys(compiled, count, wrapping):
    seeds = Rows.of(streams.Seed, [streams.seed_words(seed) for seed in SEEDS])
    numbers = Rows.empty(float, count)
    flying = program([Stage(draw, View(seeds, streams.ziggurat(), numbers))], compiled)
    for k, seed in enumerate(SEEDS):
        flying.run(k, k + 1)
        np.testing.assert_array_equal(
            numbers.array[:, 0], generator(seed, 1).standard_normal(count)
        )
    if compiled:  # the rarest way through the ziggurat was among them
        assert np.abs(numbers.array).max() > streams.TAIL
