"""Vectors as triples: exact on whole numbers, and lengths of any size."""

import itertools
import math

import numpy as np
import pytest

from replay.numerics import triples
from replay.numerics.jit import kernel
from tests.amounts import cases


@kernel
def every_product(p, a, q, b):
    return (
        triples.minus(a, b),
        triples.scaled(p, a),
        triples.along(a, p, b),
        triples.combined(p, a, q, b),
        triples.cross(a, b),
        triples.dot(a, b),
    )


def test_sums_and_products_of_whole_numbers_are_exact():
    rng = np.random.default_rng(1)
    for _ in range(cases(500)):
        a, b = rng.integers(-99, 100, (2, 3)).astype(float)
        p, q = rng.integers(-9, 10, 2).astype(float)
        difference, scaled, along, combined, cross, dot = every_product(p, tuple(a), q, tuple(b))
        assert difference == tuple(a - b)
        assert scaled == tuple(p * a)
        assert along == tuple(a + p * b)
        assert combined == tuple(p * a + q * b)
        assert cross == tuple(np.cross(a, b))
        assert dot == sum(x * y for x, y in zip(a, b, strict=True))


def test_unit_vectors_are_right_handed():
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    for a, b, c in ((x, y, z), (y, z, x), (z, x, y)):
        assert every_product(0.0, a, 0.0, b)[4] == c
        assert every_product(0.0, b, 0.0, a)[4] == tuple(-v for v in c)


@pytest.mark.parametrize("size", [1.0, 1e150, 1e-130, 1e-139, 1e-141, 1e-150, 1e-200, 1e-300, 5e-324])
def test_a_length_is_right_whatever_its_size(size):
    for sides in ((3.0, 4.0, 0.0), (2.0, 3.0, 6.0), (1.0, 4.0, 8.0), (0.0, 0.0, 7.0)):
        length = math.sqrt(sum(side * side for side in sides))
        for order in itertools.permutations(sides):
            for signs in itertools.product((1.0, -1.0), repeat=3):
                vector = tuple(sign * side * size for sign, side in zip(signs, order, strict=True))
                assert triples.norm(vector) == pytest.approx(length * size, rel=1e-15, abs=5e-324)
    assert triples.norm((0.0, -0.0, 0.0)) == 0.0
