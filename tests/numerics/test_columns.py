"""What follows for a column from the type that it is declared with."""

import enum
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from replay.numerics.columns import Columns, Field, Kind


class State(enum.IntEnum):
    OFF = 0
    ON = 1
    BROKEN = 2


@dataclass(frozen=True, eq=False)
class Readings(Columns):
    state: Annotated[NDArray[np.uint8], Field(states=State)]
    count: Annotated[NDArray[np.int32], Field()]
    case: Annotated[NDArray[np.uint8], Field(most=5)]
    code: Annotated[NDArray[np.uint8], Field()]
    flag: Annotated[NDArray[np.bool_], Field()]
    length: Annotated[NDArray[np.float64], Field(unit="m")]


def test_what_follows_from_the_types():
    fields = {field.name: field for field in Readings.fields()}
    assert [field.most for field in fields.values()] == [2, 2**31 - 1, 5, 255, 1, 0]
    kinds = [Kind.LEVEL, Kind.CATEGORY, Kind.CATEGORY, Kind.CATEGORY, Kind.FLAG, Kind.NUMBER]
    assert [field.kind for field in fields.values()] == kinds


def test_columns_that_tell_nothing_hold_what_says_so():
    columns = Readings.nothing(2, 3)
    assert columns.count.tolist() == [[-1] * 3] * 2 and columns.count.dtype == np.int32
    assert np.isnan(columns.length).all() and not columns.flag.any() and not columns.state.any()
