"""Cross products and normals against exact rational arithmetic, where plain ones are noise."""

import math
from fractions import Fraction

import numpy as np

from replay.numerics.jit import kernel
from replay.sensing.distance.products import accurate_cross, accurate_normal, fma
from tests.amounts import cases


def exact(vector):
    return [Fraction(float(component)) for component in vector]


def exact_cross(a, b):
    return [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]


def relative_error(value, truth):
    difference = [Fraction(v) - t for v, t in zip(value, truth, strict=True)]
    return math.sqrt(sum(d * d for d in difference) / sum(t * t for t in truth))


def test_cross_product_of_nearly_parallel_vectors():
    rng = np.random.default_rng(1)
    for _ in range(cases(200)):
        a = rng.normal(size=3)
        b = a * rng.uniform(0.1, 3.0) + rng.normal(size=3) * 10.0 ** rng.uniform(-17, 0)
        truth = exact_cross(exact(a), exact(b))
        if any(truth):
            assert relative_error(accurate_cross(tuple(a), tuple(b)), truth) < 5e-16


def test_normal_of_slivers():
    rng = np.random.default_rng(2)
    for _ in range(cases(200)):
        a, b = rng.normal(size=3), rng.normal(size=3)
        c = a + rng.uniform() * (b - a) + rng.normal(size=3) * 10.0 ** rng.uniform(-15, 0)
        u = [y - x for x, y in zip(exact(a), exact(b), strict=True)]
        w = [y - x for x, y in zip(exact(a), exact(c), strict=True)]
        truth = exact_cross(u, w)
        assert relative_error(accurate_normal(tuple(a), tuple(b), tuple(c)), truth) < 1e-14


@kernel
def compiled_fma(x, y, z):
    return fma(x, y, z)


def test_fused_multiply_add_rounds_once():
    rng = np.random.default_rng(3)
    for x, y in rng.normal(size=(100, 2)):
        assert compiled_fma(x, y, -(x * y)) == fma(x, y, -(x * y))
        assert Fraction(compiled_fma(x, y, -(x * y))) == Fraction(x) * Fraction(y) - Fraction(x * y)
