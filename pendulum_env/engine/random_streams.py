"""Random numbers for many environments at once: NumPy's PCG64 generators as arrays, 32 bytes each.

Stream ``i`` gives the same numbers as ``numpy.random.Generator(numpy.random.PCG64(seed_i)).random()``, the generator
of ``gymnasium.utils.seeding.np_random(seed_i)``, without its 1 kB and 10 microseconds per environment.
Sources: O'Neill 2014, PCG: a family of simple fast space-efficient statistically good algorithms (XSL-RR 128/64);
the seeding is NumPy's SeedSequence, after O'Neill 2015, Developing a seed_seq alternative.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint64]
Pair = tuple[Words, Words]
Seeds = Sequence[int] | Words

MOST_SEED = 2**128 - 1
"""Largest seed of a stream; it fills the 128-bit pool of NumPy's SeedSequence."""

AT_ONCE = 4096
"""Number of streams that are seeded or drawn from at once: few enough for what is computed on the way to be small."""

_HALF, _LOW = np.uint64(32), np.uint64(0xFFFFFFFF)
_STEP_HIGH, _STEP_LOW = np.uint64(0x2360ED051FC65DA4), np.uint64(0x4385DF649FCCF645)


def _product_high(a: np.uint64, b: Words) -> Words:
    """Return the upper 64 bits of the 128-bit product of two 64-bit numbers."""
    a_high, a_low, b_high, b_low = a >> _HALF, a & _LOW, b >> _HALF, b & _LOW
    middle = a_high * b_low + (a_low * b_low >> _HALF)
    cross = a_low * b_high + (middle & _LOW)
    high: Words = a_high * b_high + (middle >> _HALF) + (cross >> _HALF)
    return high


def _sum(a: Pair, b: Pair) -> Pair:
    """Return the 128-bit sum of two numbers given as (high, low) pairs of 64-bit words."""
    low = a[1] + b[1]
    return a[0] + b[0] + (low < a[1]), low


def _next(state: Pair, increment: Pair) -> Pair:
    """Return the next state of the 128-bit linear congruential generator PCG64."""
    high, low = state
    product = (_product_high(_STEP_LOW, low) + _STEP_HIGH * low + _STEP_LOW * high, _STEP_LOW * low)
    return _sum(product, increment)


class Streams:
    """Independent random streams, one per environment.

    Args:
        seeds: one whole number from 0 to 2**128 - 1 per stream, as a sequence or, if all are below 2**64, as an array.
    """

    def __init__(self, seeds: Seeds) -> None:
        zeros = np.zeros(len(seeds), dtype=np.uint64)
        self._state: Pair = (zeros, zeros.copy())
        self._increment: Pair = (zeros.copy(), zeros.copy())
        self.seed(np.arange(len(seeds)), seeds)

    def seed(self, which: NDArray[np.intp], seeds: Seeds) -> None:
        """Restart the random streams with the indices ``which`` from new seeds."""
        for first in range(0, len(which), AT_ONCE):
            self._seed(which[first:first + AT_ONCE], seeds[first:first + AT_ONCE])

    def _seed(self, which: NDArray[np.intp], seeds: Seeds) -> None:
        small = isinstance(seeds, range) and seeds.stop <= 2**64
        words = _seed_sequence(words_of_range(seeds) if small else seeds)  # type: ignore[arg-type]
        with np.errstate(over="ignore"):
            one = np.uint64(1)
            increment = (words[2] << one | words[3] >> np.uint64(63), words[3] << one | one)
            state = _next(_sum(increment, (words[0], words[1])), increment)
        for target, values in zip((*self._state, *self._increment), (*state, *increment), strict=True):
            target[which] = values

    def words(self, which: Any) -> Words:
        """Return the state and the increment of every stream in ``which``, each as (high, low), an array ``(4, n)``."""
        return np.stack([words[which] for words in (*self._state, *self._increment)])

    def restore(self, which: Any, words: Words) -> None:
        """Set the streams with the indices ``which`` to states that :meth:`words` returned."""
        for target, values in zip((*self._state, *self._increment), words, strict=True):
            target[which] = values

    def uniform(self, which: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the next random number in [0, 1) of every stream in ``which``, an array of distinct indices."""
        numbers = np.empty(len(which))
        for first in range(0, len(which), AT_ONCE):
            numbers[first:first + AT_ONCE] = self._uniform(which[first:first + AT_ONCE])
        return numbers

    def _uniform(self, which: NDArray[np.intp]) -> NDArray[np.float64]:
        places = neighbours(which)
        increment = (self._increment[0][places], self._increment[1][places])
        with np.errstate(over="ignore"):
            high, low = _next((self._state[0][places], self._state[1][places]), increment)
            self._state[0][places], self._state[1][places] = high, low
            mixed, turn = high ^ low, high >> np.uint64(58)
            bits = mixed >> turn | mixed << (np.uint64(64) - turn & np.uint64(63))
        return np.asarray((bits >> np.uint64(11)).astype(np.float64) * 2.0**-53)

    def generators(self, which: NDArray[np.intp]) -> Iterator[np.random.Generator]:
        """Yield a NumPy generator for every stream in ``which``, which continues it until the next is yielded.

        It is the same object each time. Its unused half of a 64-bit number, if there is one, is dropped afterwards.
        """
        source = np.random.PCG64(0)
        generator = np.random.Generator(source)
        for place in which:
            source.state = generator_state(self.words(place))
            yield generator
            self.restore(place, words_of(source.state))


def neighbours(which: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """Return indices that follow each other without a gap as a slice, which numpy reads faster; others unchanged."""
    if len(which) and which[0] >= 0 and (which[1:] - which[:-1] == 1).all():
        return slice(int(which[0]), int(which[-1]) + 1)
    return which


def generator_state(words: Words) -> Any:
    """Return a stream's four words as the ``state`` of the NumPy generator PCG64 that goes on with the same numbers."""
    high, low, above, below = map(int, words)
    return {"bit_generator": "PCG64", "state": {"state": high << 64 | low, "inc": above << 64 | below},
            "has_uint32": 0, "uinteger": 0}


def words_of(state: Mapping[str, Any]) -> Words:
    """Return the four words of a stream from the ``state`` of a NumPy generator PCG64."""
    return np.array([state["state"][name] >> shift & 2**64 - 1 for name in ("state", "inc") for shift in (64, 0)],
                    dtype=np.uint64)


def words_of_range(seeds: range) -> Words:
    """Return consecutive whole numbers from 0 to 2**64 - 1 as an array."""
    return np.arange(len(seeds), dtype=np.uint64) + np.uint64(seeds.start)


def fresh_seeds(size: int) -> Words:
    """Return ``size`` unpredictable seeds from the operating system's entropy."""
    return np.random.SeedSequence().generate_state(size, np.uint64).astype(np.uint64)


def _seed_sequence(seeds: Seeds) -> list[Words]:
    """Return NumPy's ``SeedSequence(seed).generate_state(4, uint64)`` for every seed."""
    if isinstance(seeds, np.ndarray):
        pool = [(seeds & _LOW).astype(np.uint32), (seeds >> _HALF).astype(np.uint32)]
        pool += [np.zeros_like(pool[0]), np.zeros_like(pool[0])]
    else:
        pool = [np.array([seed >> 32 * k & 0xFFFFFFFF for seed in seeds], dtype=np.uint32) for k in range(4)]
    with np.errstate(over="ignore"):
        constant = np.uint32(0x43B0D7E5)
        shift = np.uint32(16)

        def hashed(value: NDArray[np.uint32]) -> NDArray[np.uint32]:
            """Return the hash of 32-bit words as in NumPy's SeedSequence, and advance the hash's constant."""
            nonlocal constant
            value = value ^ constant
            constant = constant * np.uint32(0x931E8875)
            value = value * constant
            return value ^ value >> shift

        pool = [hashed(word) for word in pool]
        for source in range(4):
            for target in range(4):
                if source != target:
                    mixed = np.uint32(0xCA01F9DD) * pool[target] - np.uint32(0x4973F715) * hashed(pool[source])
                    pool[target] = mixed ^ mixed >> shift
        constant, state = np.uint32(0x8B51F9DD), []
        for k in range(8):
            value = pool[k % 4] ^ constant
            constant = constant * np.uint32(0x58F38DED)
            value = value * constant
            state.append((value ^ value >> shift).astype(np.uint64))
    return [state[2 * k] | state[2 * k + 1] << _HALF for k in range(4)]
