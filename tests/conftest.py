"""The same examples on every run of `make test`; `make soak` looks for new ones. Compiling kernels is not told."""

import pytest
from hypothesis import settings

from replay.numerics.jit import progress
from tests.amounts import COMPILED, cases

settings.register_profile("seeded", derandomize=True, deadline=None, max_examples=cases(100))
settings.register_profile("soak", deadline=None, print_blob=True)


def pytest_configure(config: pytest.Config) -> None:
    progress.tell_by(lambda state: None, lambda text: None)  # else it would be in what tests read on stderr
    settings.load_profile("soak" if config.option.markexpr == "soak" else "seeded")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave out what needs compiled kernels, where NUMBA_DISABLE_JIT=1 runs them as plain Python."""
    for item in items:
        if not COMPILED and item.get_closest_marker("compiled"):
            item.add_marker(pytest.mark.skip(reason="needs compiled kernels"))
