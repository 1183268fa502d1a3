"""All capacitive sensors of a scene, over all frames of a block."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import InvalidValue
from replay.geometry import tree
from replay.kinematics.linkage import POSE_ROUNDING, LinkPoses
from replay.numerics import transforms
from replay.numerics.arguments import as_float
from replay.numerics.arrays import Flags, Floats
from replay.numerics.jit import entries_of
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.contact import plates_inside
from replay.sensing.capacitive.counters import CapacitiveCounters
from replay.sensing.capacitive.integral import check_splits
from replay.sensing.capacitive.sensor import CapacitiveSensor, output_voltage
from replay.sensing.capacitive.tree import clusters, moments, tree_sum
from replay.sensing.capacitive.tree.clusters import Clusters, make_clusters
from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree
from replay.sensing.capacitive.triangle_sum import EXACT, sum_triangles, triangle_areas
from replay.sensing.target import Target

METHODS = ("tree", "exact", "midpoint")
_LARGEST_EXPONENT = 500

SMALLEST_RTOL = 1e-12
"""Below it the tolerance would be lost in the rounding of a sum of many triangles."""


def kernels(*, method: str, savings: bool = True, **_numbers: float) -> tuple[Any, ...]:
    """Return the kernels that a suite with these options calls; see `CapacitiveSuite`."""
    own = entries_of(clusters, moments, tree_sum) if method == "tree" and savings else (sum_triangles,)
    return (*entries_of(tree), triangle_areas, plates_inside, *own)


class CapacitiveSuite:
    """Readings of sensors from bodies.

    Plates are placed in the body's frame through the common ancestor of both links; bodies stay as they are. Frames
    whose relative pose repeats to the last bit are computed once. A body's contribution does not depend on the other
    bodies, sensors or frames. Each body is scaled by a power of two, plates with it, so that its size does not matter.
    A corner that is in the plane of a plate or of one of its borders as far as poses are known, to 8 epsilon of the way
    from the plate over the links to it, is in it: a face flush with a plate does not lie before it, and a wall that a
    plate abuts on saturates it. As far as that, a face whose plane holds the centre of a plate does not face it.
    A plate in a body that has an inside, or flush on one and facing into it, touches it and is saturated.

    Args:
        sensors: in the order of the columns.
        targets: the sensed bodies, in the order of `per_object`.
        method: "tree" meets rtol; "exact" sums the closed form of every triangle; "midpoint" is the thesis's.
        rtol: of "tree", 1e-12..1: largest relative error of each body's contribution to each plate, and so of the sum.
        splits: of "midpoint", 0..12.
        savings: False computes every frame anew, and sums "tree" over all triangles as "exact" does: capacitances are
            then the same within rtol, and those of the other methods bit for bit (tests/test_savings.py).

    Attributes:
        counters: what was done so far.

    Raises:
        InvalidValue: an option is not as stated.

    Accuracy: "tree" stays within rtol, by a bound (test_capacitive_tree); on a phantom of 26 756 triangles, at 1 424
        poses and rtol 1e-2 to 1e-9, within 0.48 rtol (test_phantom_tolerance).
    """

    def __init__(
        self,
        sensors: Sequence[CapacitiveSensor],
        targets: Sequence[Target],
        *,
        method: str = "tree",
        rtol: float = 1e-6,
        splits: int = 4,
        savings: bool = True,
    ) -> None:
        if not isinstance(method, str) or method not in METHODS:
            raise InvalidValue("method", method, f"must be one of {', '.join(METHODS)}")
        rtol = as_float("rtol", rtol)
        if not SMALLEST_RTOL <= rtol <= 1.0:
            raise InvalidValue("rtol", rtol, f"must be from {SMALLEST_RTOL:g} to 1")
        check_splits(splits)
        self.sensors = tuple(sensors)
        self.targets = tuple(targets)
        self.method = method
        self.rtol = rtol
        self.counters = CapacitiveCounters()
        self._savings = savings
        self._splits = splits if method == "midpoint" else EXACT
        sensed = [any(sensor.senses(target.link) for sensor in self.sensors) for target in self.targets]
        self._sizes = [float(np.max(np.abs(target.triangles), initial=0.0)) for target in self.targets]
        self._scales = [_power_of_two(target.triangles) for target in self.targets]
        self._triangles = [
            np.ascontiguousarray(scale * target.triangles, dtype=np.float64)
            for target, scale in zip(self.targets, self._scales, strict=True)
        ]
        trees = [
            target.tree._replace(lower=scale * target.tree.lower, upper=scale * target.tree.upper)
            for target, scale in zip(self.targets, self._scales, strict=True)
        ]
        self._clusters: list[Clusters | None] = [
            make_clusters(triangles, tree) if needed and method == "tree" and savings else None
            for triangles, tree, needed in zip(self._triangles, trees, sensed, strict=True)
        ]
        self._areas = [triangle_areas(triangles) for triangles in self._triangles]
        self._half_sizes = [np.array([plate.half_size for plate in sensor.plates]) for sensor in self.sensors]
        self._T_plate_link = [
            transforms.invert(np.array([plate.T_link_plate for plate in sensor.plates])) for sensor in self.sensors
        ]

    def run(self, poses: LinkPoses) -> CapacitiveColumns:
        """Return the readings in every frame of `poses`; bodies that a sensor does not sense contribute 0."""
        frames = len(poses.world)
        per_object = np.zeros((frames, len(self.sensors), len(self.targets)))
        touching = np.zeros((frames, len(self.sensors)), dtype=np.bool_)
        distinct: dict[tuple[int, int], tuple[Floats, Floats, NDArray[np.intp]]] = {}
        for s, sensor in enumerate(self.sensors):
            for t, target in enumerate(self.targets):
                if not sensor.senses(target.link) or frames == 0:
                    continue
                links = (sensor.link, target.link)
                if links not in distinct:
                    T, way = np.ascontiguousarray(poses.relative(*links)), poses.way(*links)
                    distinct[links] = _distinct_poses(T, way) if self._savings else (T, way, np.arange(frames))
                T_link_body, way, frame_of = distinct[links]
                T_plate_body = transforms.compose(self._T_plate_link[s], T_link_body[:, None])
                rounding = self._rounding(s, t, way)
                integral, touches = self._integrate(s, t, T_plate_body, rounding)
                if target.closing is not None:
                    body = (target.triangles, target.tree, target.closing)
                    inside = plates_inside(*body, T_plate_body, self._half_sizes[s], rounding)
                    integral[inside], touches = np.inf, touches | inside
                plates = len(sensor.plates)
                self.counters.integrals += frames * plates
                self.counters.triangles += frames * plates * len(target.triangles)
                self.counters.repeated += (frames - len(T_link_body)) * plates
                per_object[:, s, t] = sensor.permittivity * _sum_over_plates(integral)[frame_of]
                touching[:, s] |= np.any(touches, axis=1)[frame_of]
        capacitance = np.tile(np.array([sensor.stray_capacitance for sensor in self.sensors]), (frames, 1))
        for t in range(len(self.targets)):
            capacitance += per_object[:, :, t]
        voltage = np.empty_like(capacitance)
        for s, sensor in enumerate(self.sensors):
            voltage[:, s] = output_voltage(capacitance[:, s], coupling=sensor.coupling, supply=sensor.supply)
        supply = np.array([sensor.supply for sensor in self.sensors])
        return CapacitiveColumns(
            capacitance=capacitance,
            per_object=per_object,
            output_voltage=voltage,
            delta_output=supply - voltage,
            saturated=np.isinf(capacitance),
            touching=touching,
        )

    def notes(self) -> tuple[str, ...]:
        """Return nothing: what a reader should know is in the readings."""
        return ()

    def _rounding(self, sensor_index: int, target_index: int, way: Floats) -> Floats:
        """Return how far off places may be (n,) [m], of a way (n,) [m] between the links, see `LinkPoses.way`."""
        steps = max(float(np.abs(plate.T_link_plate[:3, 3]).sum()) for plate in self.sensors[sensor_index].plates)
        return POSE_ROUNDING * (way + steps + self._sizes[target_index])

    def _integrate(
        self, sensor_index: int, target_index: int, T_plate_body: Floats, rounding: Floats
    ) -> tuple[Floats, Flags]:
        """Return the integrals [m] and the touching flags, (n, plates), of one body for the plates of one sensor."""
        sensor = self.sensors[sensor_index]
        both, facing = sensor.side == "both", sensor.faces == "facing"
        scale, clusters = self._scales[target_index], self._clusters[target_index]
        half_sizes, T = scale * self._half_sizes[sensor_index], T_plate_body.copy()
        T[..., :3, 3] *= scale
        rounding = scale * rounding
        if clusters is not None:
            counts = np.zeros(COUNTS, dtype=np.int64)
            integral, touching, _ = sum_tree(clusters, T, rounding, half_sizes, both, facing, self.rtol, counts)
            self.counters.add(counts.tolist())
        else:
            triangles, areas = self._triangles[target_index], self._areas[target_index]
            integral, touching = sum_triangles(triangles, areas, T, rounding, half_sizes, both, facing, self._splits)
        return integral / scale, touching


SUITE = CapacitiveSuite


def _power_of_two(triangles: Floats) -> float:
    """Return the power of two that brings a body to the size of 1, where products of lengths keep their digits."""
    size = float(np.max(np.abs(triangles), initial=0.0))
    exponent = -math.frexp(size)[1] if size > 0.0 else 0
    return math.ldexp(1.0, max(-_LARGEST_EXPONENT, min(exponent, _LARGEST_EXPONENT)))


def _distinct_poses(T: Floats, way: Floats) -> tuple[Floats, Floats, NDArray[np.intp]]:
    """Return the poses (m, 4, 4) that occur in T (n, 4, 4), their ways (m,), and which one each frame has.

    They come in order of appearance.
    """
    seen: dict[tuple[bytes, float], int] = {}
    keys = ((pose.tobytes(), length) for pose, length in zip(T, way.tolist(), strict=True))
    frame_of = np.array([seen.setdefault(key, len(seen)) for key in keys], dtype=np.intp)
    first = np.unique(frame_of, return_index=True)[1]
    return np.ascontiguousarray(T[first]), way[first], frame_of


def _sum_over_plates(integral: Floats) -> Floats:
    total = np.zeros(len(integral))
    for plate in range(integral.shape[1]):
        total += integral[:, plate]
    return total
