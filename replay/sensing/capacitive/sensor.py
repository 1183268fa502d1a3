"""What a sensor is: plates on one link, wired in parallel, and the voltage divider behind them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.errors import InvalidValue
from replay.numerics import transforms
from replay.numerics.arguments import as_float, as_floats
from replay.numerics.arrays import Floats
from replay.sensing.capacitive.integral import SIDES, check_half_size
from replay.sensing.capacitive.part import SUPPLY, VACUUM_PERMITTIVITY

FACES = ("all", "facing")


@dataclass(frozen=True, eq=False)
class Plate:
    """One rectangle of a sensor.

    Attributes:
        name: of the plate.
        T_link_plate: (4, 4), pose in the sensor's link; the plate is |x| <= hx, |y| <= hy, z = 0, its front is +z.
        half_size: (2,) [m], hx and hy.
    """

    name: str
    T_link_plate: Floats
    half_size: Floats

    def __post_init__(self) -> None:
        check_half_size(self.half_size)
        place = f"plate {self.name!r}: T_link_plate"
        if not _is_rigid(as_floats(place, self.T_link_plate, (4, 4))):
            raise InvalidValue(place, self.T_link_plate, "must be a rigid (4, 4) pose")


@dataclass(frozen=True, eq=False)
class CapacitiveSensor:
    """Plates of one link, wired in parallel behind one voltage divider.

    Attributes:
        name: of the sensor.
        link: index of the link that carries the plates.
        plates: at least one.
        coupling: C_couple [F], > 0.
        permittivity: eps [F/m], > 0; a fitted number (see METHODS 4.3), the vacuum's unless calibrated.
        supply: V_in [V].
        stray_capacitance: C_0 [F], >= 0; added to what is sensed.
        side: "front" counts what lies on the side of the plate's normal, "both" counts all.
        faces: "all" counts every triangle; "facing" counts those whose outer side the plate's centre lies on, strictly:
            n.(c - a) > 0 for the outward normal n, a corner a and the centre c.
        back: shapes of the link that are a conductor behind the plates: name and triangles (n, 3, 3) [m], in the link's
            frame; `driven` whether it has the plates' voltage, not 0 V. Only electrostatics knows of it.
        ignored_links: indices of links whose shapes are not sensed; the own link never is.
    """

    name: str
    link: int
    plates: tuple[Plate, ...]
    coupling: float
    permittivity: float = VACUUM_PERMITTIVITY
    supply: float = SUPPLY
    stray_capacitance: float = 0.0
    side: str = "front"
    faces: str = "all"
    back: tuple[tuple[str, Floats], ...] = ()
    driven: bool = False
    ignored_links: frozenset[int] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        place = f"sensor {self.name!r}"
        if not self.plates:
            raise InvalidValue(f"{place}: plates", (), "must be at least one")
        for name in ("coupling", "permittivity", "supply"):
            value = as_float(f"{place}: {name}", getattr(self, name))
            if not (np.isfinite(value) and value > 0.0):
                raise InvalidValue(f"{place}: {name}", value, "must be finite and > 0")
        stray = as_float(f"{place}: stray_capacitance", self.stray_capacitance)
        if not (np.isfinite(stray) and stray >= 0.0):
            raise InvalidValue(f"{place}: stray_capacitance", stray, "must be finite and >= 0")
        if not isinstance(self.side, str) or self.side not in SIDES:
            raise InvalidValue(f"{place}: side", self.side, f"must be one of {', '.join(SIDES)}")
        if not isinstance(self.faces, str) or self.faces not in FACES:
            raise InvalidValue(f"{place}: faces", self.faces, f"must be one of {', '.join(FACES)}")

    def senses(self, link: int) -> bool:
        """Return whether shapes on a link are sensed."""
        return link != self.link and link not in self.ignored_links


def _is_rigid(T: Floats) -> bool:
    if not np.isfinite(T).all() or not np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0]):
        return False
    products = transforms.compose(transforms.invert(T), T)[:3, :3]
    return bool(np.abs(products - np.eye(3)).max() < 1e-9 and np.linalg.det(T[:3, :3]) > 0.0)


def output_voltage(capacitance: ArrayLike, *, coupling: float, supply: float = SUPPLY) -> NDArray[np.float64]:
    """Return V_out = C_couple / (C_couple + C) V_in.

    Args:
        capacitance: sensed capacitance C [F], any shape, >= 0; inf (a saturated plate) gives 0 V.
        coupling: C_couple [F], > 0.
        supply: V_in [V], finite.

    Returns:
        Output voltage [V], of the shape of `capacitance`.

    Raises:
        InvalidValue: an argument is outside the stated range, or NaN.

    Source: Huijgens 2015.
    """
    try:
        shape = np.shape(capacitance)
    except (TypeError, ValueError):
        shape = ()
    sensed = as_floats("capacitance", capacitance, shape).reshape(shape)
    coupling, supply = as_float("coupling", coupling), as_float("supply", supply)
    if np.isnan(sensed).any() or (sensed < 0.0).any():
        raise InvalidValue("capacitance", capacitance, "must be >= 0 F (inf when saturated)")
    if not (np.isfinite(coupling) and coupling > 0.0):
        raise InvalidValue("coupling", coupling, "must be finite and > 0 F")
    if not np.isfinite(supply):
        raise InvalidValue("supply", supply, "must be finite")
    return np.asarray(supply / (1.0 + sensed / coupling))
