"""The factor of a matrix, beside another library's."""

from __future__ import annotations

import numpy as np
import pytest

from replay.sensing.electrostatics import cholesky


@pytest.mark.parametrize("n", [1, 2, 7, 8, 9, 63, 64, 65, 255, 300, 521])
def test_the_factor_and_what_is_solved_with_it(n: int) -> None:
    random = np.random.default_rng(n)
    half = random.normal(size=(n, n))
    matrix = half @ half.T + n * np.eye(n)
    upper = matrix.copy()
    assert cholesky.factor(upper) == -1
    assert np.allclose(np.triu(upper), np.linalg.cholesky(matrix).T, rtol=1e-10, atol=1e-10)
    right = random.normal(size=(3, n))
    found = right.copy()
    cholesky.solve(upper, 0, found)
    assert np.allclose(found, np.linalg.solve(matrix, right.T).T, rtol=1e-9, atol=1e-12)


def test_the_last_rows_are_the_factor_of_what_elimination_leaves() -> None:
    random = np.random.default_rng(3)
    half = random.normal(size=(90, 90))
    matrix = half @ half.T + 90 * np.eye(90)
    upper = matrix.copy()
    cholesky.factor(upper)
    right = random.normal(size=(2, 30))
    found = right.copy()
    cholesky.solve(upper, 60, found)
    left = matrix[60:, 60:] - matrix[60:, :60] @ np.linalg.solve(matrix[:60, :60], matrix[:60, 60:])
    assert found == pytest.approx(np.linalg.solve(left, right.T).T, rel=1e-9)


@pytest.mark.parametrize("row", [0, 5, 64, 99])
def test_a_matrix_that_is_not_positive_definite_is_told(row: int) -> None:
    matrix = np.eye(100)
    matrix[row, row] = 0.0
    assert cholesky.factor(matrix) == row
