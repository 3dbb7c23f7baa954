"""Tests of the random streams of many environments, against NumPy's generators."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.utils import seeding
from hypothesis import given, settings
from hypothesis import strategies as st

from pendulum_env.engine.random_streams import MOST_SEED, Streams


@settings(max_examples=40, deadline=None)
@given(st.lists(st.one_of(st.integers(0, 2**33), st.integers(0, MOST_SEED)), min_size=1, max_size=8))
def test_a_stream_is_numpys_generator(seeds: list[int]) -> None:
    streams, which = Streams(seeds), np.arange(len(seeds))
    generators = [seeding.np_random(seed)[0] for seed in seeds]
    for _ in range(20):
        assert streams.uniform(which).tolist() == [generator.random() for generator in generators]


@pytest.mark.parametrize("first", [0, 2**32 - 2, 2**64 - 5, 2**64 - 2, MOST_SEED - 3])
def test_consecutive_seeds_may_be_a_range(first: int) -> None:
    seeds = range(first, first + 4)
    assert Streams(seeds).uniform(np.arange(4)).tolist() == [
        np.random.default_rng(np.random.PCG64(seed)).random() for seed in seeds]


def test_each_stream_goes_on_by_itself() -> None:
    seeds = [0, 1, 2**32 - 1, 2**32, MOST_SEED]
    streams, generators = Streams(seeds), [np.random.default_rng(np.random.PCG64(seed)) for seed in seeds]
    for which in ([0, 4], [1, 2, 4], [4], [0, 1, 2, 3, 4], [2, 3], [3, 2, 1], [1, 0, 2], [-2, -1], [-1, 0]):
        assert streams.uniform(np.array(which)).tolist() == [generators[i].random() for i in which]
    streams.seed(np.array([1, 3]), [7, 8])
    again = [np.random.default_rng(np.random.PCG64(seed)).random() for seed in (7, 8)]
    assert streams.uniform(np.array([1, 3])).tolist() == again
    assert streams.uniform(np.array([0])).tolist() == [generators[0].random()]
