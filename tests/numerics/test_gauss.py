import math

import numpy as np
import pytest

from replay.numerics import gauss


@pytest.mark.parametrize("count", [4, 8, 12, 16])
def test_nodes_integrate_polynomials_of_their_degree(count):
    nodes, weights = getattr(gauss, f"NODES_{count}"), getattr(gauss, f"WEIGHTS_{count}")
    for degree in range(2 * count):
        assert (weights * nodes**degree).sum() == pytest.approx(1.0 / (degree + 1), rel=2e-15)


@pytest.mark.parametrize(("rule", "degree"), [(gauss.TRIANGLE_7, 5), (gauss.TRIANGLE_16, 8)])
def test_triangle_rules_integrate_polynomials_of_their_degree(rule, degree):
    for i in range(degree + 1):
        for j in range(degree + 1 - i):
            for k in range(degree + 1 - i - j):
                mean = (rule[3] * rule[0] ** i * rule[1] ** j * rule[2] ** k).sum()
                factorials = math.factorial(i) * math.factorial(j) * math.factorial(k)
                assert mean == pytest.approx(2.0 * factorials / math.factorial(i + j + k + 2), rel=1e-14)
    assert (rule > 0.0).all()
    np.testing.assert_allclose(rule[:3].sum(axis=0), 1.0, rtol=1e-15)
