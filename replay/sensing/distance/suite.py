"""All distance sensors of a scene, over blocks of frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from replay.errors import InvalidValue, count
from replay.geometry import surface_boxes, tree, wide_tree
from replay.geometry.containment import each_inside
from replay.geometry.tree import triangle_tree
from replay.geometry.wide_tree import widen
from replay.kinematics.linkage import POSE_ROUNDING, LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Floats, ShortIntegers
from replay.numerics.jit import entries_of
from replay.sensing.distance.closest import check_aperture, check_range
from replay.sensing.distance.columns import DistanceColumns
from replay.sensing.distance.cone import half_angle
from replay.sensing.distance.counters import DistanceCounters
from replay.sensing.distance.embree import EmbreeBundle
from replay.sensing.distance.exact import sweep_exact, sweep_scan
from replay.sensing.distance.query import COUNTS
from replay.sensing.distance.rays import cap_directions, sweep_rays
from replay.sensing.distance.readings import Nearest, nothing_yet, write_sensor
from replay.sensing.distance.thesis import sweep_thesis
from replay.sensing.target import Target

Sweep = Callable[["DistanceSensor", int, Floats, Floats, Nearest], None]

METHODS = ("exact", "rays", "thesis")
ENGINES = ("own", "embree")
TOUCHING = 1e-9
"""Readings up to this one [m] count as touching: what rounding leaves of a sensor that stands on a face."""


def kernels(*, method: str, engine: str = "own", savings: bool = True, **_numbers: int) -> tuple[Any, ...]:
    """Return the kernels that a suite with these options calls; see `DistanceSuite`."""
    used = (*entries_of(tree), each_inside)
    if method == "exact":
        return (*used, *entries_of(surface_boxes, wide_tree), sweep_exact if savings else sweep_scan)
    if method == "thesis":
        return (*used, sweep_thesis)
    return (*used, *((sweep_rays,) if engine == "own" else ()))


@dataclass(frozen=True, eq=False)
class DistanceSensor:
    """A cone that reads the closest point in it.

    Attributes:
        name: unique among the distance sensors.
        link: index of the link that carries it.
        T_link_sensor: (4, 4) its pose on the link: apex at the origin, axis +z.
        aperture: full opening angle [rad], above 0 up to 2 pi.
        range: largest distance sensed [m], 0 to inf.
        min_range: dead zone [m]: what is nearer reads as `Detection.TOO_CLOSE`, with its distance.
        ignored_links: links that the sensor does not see; its own is always ignored.
    """

    name: str
    link: int
    T_link_sensor: Floats
    aperture: float
    range: float = math.inf
    min_range: float = 0.0
    ignored_links: frozenset[int] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        check_aperture(self.aperture)
        check_range("range", self.range)
        check_range("min_range", self.min_range)
        if self.min_range > self.range:
            raise InvalidValue("min_range", self.min_range, f"must be at most the range, {self.range} m")
        pose = np.asarray(self.T_link_sensor)
        if pose.shape != (4, 4) or not np.isfinite(pose).all() or not pose[:3, 2].any():
            raise InvalidValue("T_link_sensor", pose.tolist(), "must be a rigid transform of shape (4, 4)")

    def sees(self, target: Target) -> bool:
        """Return whether the target's link is neither the sensor's own nor ignored."""
        return target.link != self.link and target.link not in self.ignored_links


class DistanceSuite:
    """Reads all distance sensors of a scene.

    Args:
        sensors: in the order of the columns.
        targets: everything that is sensed; `DistanceColumns.shape` counts them.
        method: "exact"; "rays", a bundle of `count` rays; or "thesis", the thesis's own steps with their failures.
        count: number of rays, 1 or more; used by "rays" only.
        engine: "own" or "embree" (float32, needs the package embreex); used by "rays" only.
        savings: False looks at every triangle in every frame, and takes nothing from the frame before; the readings are
            the same bit for bit (tests/test_savings.py); of "rays", but where a ray all but lies in a triangle's plane.

    An apex inside a body reads the closest point of the body's surface in the cone all the same, from within; `notes`
    says so. An apex on a face of a target reads 0 with it, whichever way the sensor looks, as far as poses are known:
    to 8 epsilon of the way from the sensor over the links to the face (methods "exact", and "rays" with engine "own").

    Attributes:
        counters: what was done so far.

    Raises:
        InvalidValue: an unknown method or engine, or a count below 1.
        MissingPackageError: the engine is not installed; another one never takes its place.
    """

    def __init__(
        self,
        sensors: Sequence[DistanceSensor],
        targets: Sequence[Target],
        *,
        method: str = "exact",
        count: int = 1000,
        engine: str = "own",
        savings: bool = True,
    ) -> None:
        if method not in METHODS:
            raise InvalidValue("method", method, f"must be one of {', '.join(METHODS)}")
        if engine not in ENGINES:
            raise InvalidValue("engine", engine, f"must be one of {', '.join(ENGINES)}")
        if count < 1:
            raise InvalidValue("count", count, "must be 1 or more")
        self.sensors = tuple(sensors)
        self.targets = tuple(targets)
        self.method = method
        self._sizes = [float(np.max(np.abs(target.triangles))) for target in targets]
        self._count = count
        self._savings = savings
        self.counters = DistanceCounters()
        self._sweep = self._sweeper(engine)
        self._covered: ShortIntegers | None = None
        self._frames, self._inside = 0, np.zeros((len(self.sensors), len(self.targets)), dtype=np.int64)

    def run(self, poses: LinkPoses) -> DistanceColumns:
        """Return the readings of all sensors in all frames of a block.

        Args:
            poses: of all links, n frames.

        Returns:
            Columns (n, D), in the order of the sensors given. "rays" has no case: its `case` is 0.
        """
        frames = len(poses.local)
        columns = DistanceColumns.nothing(frames, len(self.sensors))
        relative: dict[tuple[int, int], Floats] = {}
        way: dict[tuple[int, int], Floats] = {}
        for column, sensor in enumerate(self.sensors):
            nearest = nothing_yet(frames)
            T_target_sensor: dict[int, Floats] = {}
            for index, target in enumerate(self.targets):
                if not sensor.sees(target):
                    continue
                links = (target.link, sensor.link)
                if links not in relative:
                    relative[links] = poses.relative(*links)
                    way[links] = poses.way(*links)
                T_target_sensor[index] = transforms.compose(relative[links], sensor.T_link_sensor)
                rounding = POSE_ROUNDING * (way[links] + self._sizes[index] + np.abs(sensor.T_link_sensor[:3, 3]).sum())
                self.counters.readings += frames
                self.counters.triangles += frames * len(target.triangles)
                if self._savings:
                    self._sweep(sensor, index, T_target_sensor[index], rounding, nearest)
                    continue
                for frame in range(frames):  # alone, a frame has none before it
                    part = slice(frame, frame + 1)
                    self._sweep(sensor, index, T_target_sensor[index][part], rounding[part], nearest.of(part))
            write_sensor(columns, column, nearest, self.targets, T_target_sensor, poses, sensor.min_range)
            self._count_inside(column, nearest, T_target_sensor)
        self._frames += frames
        if frames:
            self._follow_covered(columns)
        return columns

    def notes(self) -> tuple[str, ...]:
        """Return a line for each sensor that a body touched in all frames so far, or whose apex was inside of one.

        What touches in every frame is most likely a part that the sensor stands on and should ignore.
        """
        covered = (
            f"distance sensor {self.sensors[s].name!r} touches {self.targets[t].name} in every frame; "
            "let it ignore that link, or move it out"
            for s, t in enumerate(self._covered if self._covered is not None else ())
            if t >= 0
        )
        inside = (
            f"distance sensor {self.sensors[s].name!r} is inside {self.targets[t].name} in {self._inside[s, t]} of "
            f"{count(self._frames, 'frame')}; it reads the surface around it, from within"
            for s, t in np.argwhere(self._inside).tolist()
        )
        return *covered, *inside

    def _follow_covered(self, columns: DistanceColumns) -> None:
        touching = np.where(columns.distance <= TOUCHING, columns.shape, -1)
        first = touching[0] if self._covered is None else self._covered
        self._covered = np.where((touching == first).all(axis=0), first, -1)

    def _count_inside(self, column: int, nearest: Nearest, T_target_sensor: dict[int, Floats]) -> None:
        for index, pose in T_target_sensor.items():
            target = self.targets[index]
            if target.closing is not None:
                apex = np.ascontiguousarray(pose[:, :3, 3])
                held = each_inside(apex, target.triangles, target.tree, target.closing)
                self._inside[column, index] += np.count_nonzero(held & (nearest.distance > 0.0))

    def _sweeper(self, engine: str) -> Sweep:
        if self.method == "exact":
            self._wide = [widen(target.tree, target.triangles) for target in self.targets]
            return self._exact
        if self.method == "thesis":
            return self._thesis
        self._patterns = [cap_directions(sensor.aperture, self._count) for sensor in self.sensors]
        if engine == "own":
            self._trees = [
                target.tree if self._savings else triangle_tree(target.triangles, leaf_size=len(target.triangles))
                for target in self.targets
            ]
            return self._rays
        bundles = [EmbreeBundle(target.triangles) for target in self.targets]

        def embree(sensor: DistanceSensor, index: int, pose: Floats, _rounding: Floats, nearest: Nearest) -> None:
            bundles[index].sweep(pose, self._pattern(sensor), sensor.range, index, nearest)

        return embree

    def _pattern(self, sensor: DistanceSensor) -> Floats:
        return self._patterns[self.sensors.index(sensor)]

    def _exact(self, sensor: DistanceSensor, index: int, pose: Floats, rounding: Floats, nearest: Nearest) -> None:
        target = self.targets[index]
        cone, counts = (*half_angle(sensor.aperture), rounding, sensor.range), np.zeros(COUNTS, dtype=np.int64)
        if self._savings:
            sweep_exact(target.triangles, self._wide[index], pose, *cone, index, nearest, counts)
        else:
            sweep_scan(target.triangles, pose, *cone, index, nearest, counts)
        self.counters.add(counts.tolist())

    def _thesis(self, sensor: DistanceSensor, index: int, pose: Floats, _rounding: Floats, nearest: Nearest) -> None:
        cos_half = math.cos(0.5 * sensor.aperture)
        sweep_thesis(self.targets[index].triangles, pose, cos_half, sensor.range, index, nearest)

    def _rays(self, sensor: DistanceSensor, index: int, pose: Floats, rounding: Floats, nearest: Nearest) -> None:
        triangles, pattern = self.targets[index].triangles, self._pattern(sensor)
        sweep_rays(triangles, self._trees[index], pose, pattern, rounding, sensor.range, index, nearest)


SUITE = DistanceSuite
