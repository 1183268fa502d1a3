"""Drawings of curves: what was measured and what the model says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import printable
from replay.logs.part_file import write_file

PANEL_INCHES = (5.2, 3.9)
_COLORS = ("#1f5fa8", "#c4521a", "#3b7d3b", "#7a4a9c", "#8a6d1c", "#555555")


@dataclass(frozen=True)
class Line:
    """One curve of a panel: values at x, as points (measured) or as a line (computed); `color` counts the colours."""

    label: str
    x: ArrayLike
    y: ArrayLike
    points: bool = False
    color: int = 0


@dataclass(frozen=True)
class Panel:
    """One drawing: title, what the axes show (with units), its curves, and whether both axes are logarithmic."""

    title: str
    x: str
    y: str
    lines: Sequence[Line]
    logarithmic: bool = False


def draw(
    path: Path, panels: Sequence[Panel], *, columns: int = 2, overwrite: bool = False, named: bool = False
) -> None:
    """Write panels as one PNG; `overwrite` and `named` as of `write_file`.

    Raises:
        RecordingExistsError: the file exists and `overwrite` is false.
        WriteError: the file cannot be written.
    """
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # not the settings in a matplotlibrc of the current folder, or of the user
        picture = _picture(panels, columns)
    write_file(path, picture, overwrite=overwrite, named=named)


def _picture(panels: Sequence[Panel], columns: int) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(columns * PANEL_INCHES[0], rows * PANEL_INCHES[1]), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.ravel(figure.subplots(rows, columns, squeeze=False))
    for panel, axis in zip(panels, axes, strict=False):
        for line in panel.lines:
            style = {"marker": "o", "linestyle": "none"} if line.points else {"linestyle": "-", "linewidth": 1.5}
            axis.plot(line.x, line.y, label=_plain(line.label), color=_COLORS[line.color % len(_COLORS)], **style)
        if panel.logarithmic:
            axis.set_xscale("log")
            axis.set_yscale("log")
        axis.set(title=_plain(panel.title, keep="\n"), xlabel=_plain(panel.x), ylabel=_plain(panel.y))
        axis.grid(visible=True, alpha=0.3)
        axis.legend(fontsize="small")
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    return picture.getvalue()


def _plain(text: str, *, keep: str = "") -> str:
    """Return text of others for a drawing, in which dollars would begin a formula; `keep` as of `printable`."""
    return printable(text, keep=keep).replace("$", r"\$")
