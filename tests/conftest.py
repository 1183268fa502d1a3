"""The same examples on every run of `make test`; `make soak` looks for new ones. Compiling kernels is not told."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from replay.numerics import remarks
from replay.numerics.jit import progress
from tests.amounts import COMPILED, KERNEL_ROOMS, cases, few_of_many

settings.register_profile("seeded", derandomize=True, deadline=None, max_examples=cases(100))
settings.register_profile("soak", deadline=None, print_blob=True)


def pytest_configure(config: pytest.Config) -> None:
    progress.tell_by(lambda state: None)  # else it would be in what tests read on stderr
    remarks.tell_by(lambda text: None)
    settings.load_profile("soak" if config.option.markexpr == "soak" else "seeded")
    if not COMPILED:
        np.seterr(all="ignore")  # compiled kernels go on with infinities and NaN, and say nothing


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where kernels are plain Python, leave out what needs compiled ones, and of many cases most."""
    if COMPILED:
        return
    tests = Path(__file__).parent
    slow = [item for item in items if item.path.relative_to(tests).parts[0] in KERNEL_ROOMS]
    kept = few_of_many([item.nodeid.partition("[")[0] for item in slow])
    dropped = {item for item, keep in zip(slow, kept, strict=True) if not keep}
    config.hook.pytest_deselected(items=list(dropped))
    items[:] = [item for item in items if item not in dropped]
    for item in items:
        if item.get_closest_marker("compiled"):
            item.add_marker(pytest.mark.skip(reason="needs compiled kernels"))
