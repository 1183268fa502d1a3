"""Results as tables: aligned text for people, CSV for programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Cell = str | float | int


@dataclass(frozen=True)
class Table:
    """Rows of equal columns, with a title, remarks on what they show, and a name for files."""

    name: str
    title: str
    rows: Sequence[Mapping[str, Cell]]
    remarks: Sequence[str] = ()

    def text(self) -> str:
        """Return title, aligned columns (numbers to 4 digits, to the right) and remarks."""
        columns = list(self.rows[0])
        cells = [columns, *([_shown(row[column]) for column in columns] for row in self.rows)]
        widths = [max(len(line[k]) for line in cells) for k in range(len(columns))]
        numeric = [not isinstance(self.rows[0][column], str) for column in columns]
        lines = [
            "  ".join(
                cell.rjust(width) if right else cell.ljust(width)
                for cell, width, right in zip(line, widths, numeric, strict=True)
            ).rstrip()
            for line in cells
        ]
        return "\n".join([self.title, *(f"  {line}" for line in lines), *self.remarks])

    def csv(self) -> str:
        """Return the rows as CSV, numbers with all digits."""
        stream = io.StringIO()
        writer = csv.DictWriter(stream, list(self.rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        return stream.getvalue()


def _shown(cell: Cell) -> str:
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)
