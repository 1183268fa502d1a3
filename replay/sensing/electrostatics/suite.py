"""All capacitive sensors of a scene by electrostatics, over all frames of a block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from replay.geometry import containment
from replay.kinematics.linkage import LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats
from replay.numerics.jit import entries_of
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.part import VACUUM_PERMITTIVITY
from replay.sensing.electrostatics import (
    bem,
    cholesky,
    circuit,
    coupling,
    cut,
    gap,
    influence,
    nodes,
    potential_grid,
    products,
    proxy,
)
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.circuit import output_voltages
from replay.sensing.electrostatics.conductors import FOUR_PI_EPSILON, Station, stations
from replay.sensing.electrostatics.contacts import stand
from replay.sensing.electrostatics.field import FieldSolver
from replay.sensing.electrostatics.keyframes import between_keys, pieces
from replay.sensing.electrostatics.motion import PoseTrack, Solved
from replay.sensing.electrostatics.placement import PosedBodies
from replay.sensing.electrostatics.proxy import Proxy
from replay.sensing.electrostatics.unit import MOST_PANELS, Unit
from replay.sensing.target import Target

_TOLERANCE = 5e-3
"""Largest share of a reading by which a spline between frames that are solved may miss."""

PANELS = {"bem": MOST_PANELS, "field": 3000}
"""The most panels of a unit's own meshes, by method."""

FEW = 5
"""Poses that are solved without asking whether splines would do."""


def kernels(*, method: str, savings: bool = True, **_options: Any) -> tuple[Any, ...]:
    """Return the kernels that a suite with these options calls; see `ElectrostaticSuite`."""
    shared = entries_of(containment, influence, cholesky, products, gap, circuit, proxy)
    return (*shared, *entries_of(cut, nodes, coupling, potential_grid)) if method == "field" else shared


class Solver(Protocol):
    """What solves the poses of bodies before a unit."""

    def read(self, placement: PosedBodies) -> bem.BemReading | None:
        """Return what bodies change in one pose; None where there is no answer."""

    def proxies(self, T: Floats) -> Floats:
        """Return E (n, k) [m] of n poses (n, bodies, 4, 4), see `keyframes`."""


class Reference:
    """Solves by `bem`; arguments as of `proxy.Proxy`."""

    def __init__(self, unit: Unit, surface: Floats, bodies: tuple[ConductorBody, ...]) -> None:
        self._unit = unit
        self._proxy = Proxy(unit, surface, bodies)

    def read(self, placement: PosedBodies) -> bem.BemReading | None:
        """See `Solver`."""
        return bem.read(self._unit, placement)

    def proxies(self, T: Floats) -> Floats:
        """See `Solver`."""
        return np.stack([self._proxy.of(poses) for poses in T])


class ElectrostaticSuite:
    """Readings of sensors from conductors.

    Bodies that come nearer to a unit than 3 mm are read at 3 mm; the error is NaN then, and `unresolved` set. A sensor
    whose plate a body touches, meets or holds is saturated; the others of its unit feel what of the body is beyond.

    Args:
        sensors: in the order of the columns.
        targets: the sensed shapes, in the order of `per_object`.
        method: "field", or "bem".
        drive: "alone": output voltages with one sensor of a unit driven at a time; "together": with all of them.
        accuracy: of "field": error, as a share of a reading, from which on more unknowns are taken.
        savings: False solves every frame anew; else readings of frames between those that are solved are splines, and
            `error` holds what that costs, at most about 0.5 %, of "field" a third of `accuracy` (`keyframes`).
        watched: names of sensors whose units are solved in every frame: what they read must not depend on later ones.

    Attributes:
        stations: the units.
        solved: how many poses were solved so far.

    Raises:
        InvalidValue: sensors on one link that ignore other links or drive what is behind them differently; electrodes
            that touch each other; a conductor without area; more unknowns than the method takes.
    """

    def __init__(
        self,
        sensors: Sequence[Any],
        targets: Sequence[Target],
        *,
        method: str = "field",
        drive: str = "alone",
        accuracy: float = 0.03,
        savings: bool = True,
        watched: frozenset[str] = frozenset(),
    ) -> None:
        self.sensors = tuple(sensors)
        self.targets = tuple(targets)
        self.method = method
        self.stations = stations(self.sensors, self.targets, most_panels=PANELS[method])
        self.solved = 0
        self._accuracy = accuracy
        self._tolerance = accuracy / 3.0 if method == "field" else _TOLERANCE
        self._solvers: dict[int, Solver] = {}
        self._together = drive == "together"
        self._savings = savings
        self._watched = watched
        self._factor = np.array([sensor.permittivity / VACUUM_PERMITTIVITY for sensor in self.sensors])

    def run(self, poses: LinkPoses) -> CapacitiveColumns:
        """Return the readings in every frame of `poses`."""
        frames, sensors = len(poses.world), len(self.sensors)
        columns = CapacitiveColumns(
            capacitance=np.zeros((frames, sensors)),
            output_voltage=np.zeros((frames, sensors)),
            delta_output=np.zeros((frames, sensors)),
            saturated=np.zeros((frames, sensors), np.bool_),
            touching=np.zeros((frames, sensors), np.bool_),
            per_object=np.zeros((frames, sensors, len(self.targets))),
            increase=np.zeros((frames, sensors)),
            error=np.zeros((frames, sensors)),
            unresolved=np.zeros((frames, sensors), np.bool_),
        )
        if frames:
            for station in self.stations:
                self._fill(columns, station, self._solved(station, poses))
        return columns

    def notes(self) -> tuple[str, ...]:
        """Return nothing: what a reader should know is in the readings."""
        return ()

    def _solved(self, station: Station, poses: LinkPoses) -> Solved:
        """Return what the bodies change in every frame."""
        frames, k = len(poses.world), len(station.unit.electrodes)
        if not station.bodies:
            return Solved.nothing(frames, k, len(station.plates))
        T = np.stack([poses.relative(station.link, link) for link in station.links], axis=1)
        splines = self._savings and not any(self.sensors[column].name in self._watched for column in station.sensors)
        track = PoseTrack.of(T) if self._savings else PoseTrack.every(T)
        targets = [self.targets[column] for column in station.objects]
        standing = stand(station, targets, np.ascontiguousarray(track.poses))
        readings: dict[int, bem.BemReading | None] = {}

        solver = self._solver(station)

        def solve(pose: int) -> bem.BemReading | None:
            if pose not in readings:
                readings[pose] = solver.read(standing.placements[pose])
                self.solved += 1
            return readings[pose]

        if splines and len(track.poses) > FEW:
            placed = np.array([placement.poses for placement in standing.placements])
            found = between_keys(
                lambda frame: solve(int(track.pose_of[frame])),
                solver.proxies(placed)[track.pose_of],
                pieces(_outlines(station.bodies, placed)[track.pose_of], standing.states[track.pose_of]),
                self._tolerance,
            )
            if found is not None:
                touching, unresolved = standing.touching[track.pose_of], standing.unresolved[track.pose_of]
                return Solved(found.increase, found.error, found.shares, touching, unresolved)
        return Solved.of(standing, [solve(pose) for pose in range(len(track.poses))], k)[track.pose_of]

    def _solver(self, station: Station) -> Solver:
        """Return what solves the poses of a unit."""
        if station.link not in self._solvers:
            self._solvers[station.link] = (
                FieldSolver(station.unit, station.bodies, behind=station.has_back, accuracy=self._accuracy)
                if self.method == "field"
                else Reference(station.unit, station.surface, station.bodies)
            )
        return self._solvers[station.link]

    def _fill(self, columns: CapacitiveColumns, station: Station, solved: Solved) -> None:
        """Write the readings of one unit."""
        at, k = station.sensors, len(station.sensors)
        own = [self.sensors[column] for column in at]
        factor = np.sqrt(self._factor[at][:, None] * self._factor[at]) * FOUR_PI_EPSILON
        behind = self._factor[at] * FOUR_PI_EPSILON
        alone, increase, error = station.unit.matrix, solved.increase, solved.error
        matrix = np.ascontiguousarray(factor * (alone + increase)[:, :k, :k])
        to_back = np.zeros((len(increase), k))
        each = (np.arange(k), np.arange(k))
        capacitance = matrix[:, *each]
        increases, errors = behind * increase[:, *each], behind * error[:, *each]
        shares = behind * solved.shares[:, :, *each]
        if station.has_back:
            to_back = np.ascontiguousarray(behind * (alone + increase)[:, :k, k])
        if station.has_back and station.driven:
            capacitance = capacitance + to_back
            increases = increases + behind * increase[:, :k, k]
            errors = errors + behind * error[:, :k, k]
            shares = shares + behind * solved.shares[:, :, :k, k]
        saturated: Flags = np.asarray(solved.touching.any(axis=2))
        stray = np.array([sensor.stray_capacitance for sensor in own])
        supply = np.array([sensor.supply for sensor in own])
        coupling = np.array([sensor.coupling for sensor in own])
        unresolved = solved.unresolved[:, None] & ~saturated
        shown = np.where(solved.touching, np.inf, np.where(saturated[:, :, None], 0.0, shares.transpose(0, 2, 1)))
        assert columns.increase is not None and columns.error is not None and columns.unresolved is not None
        columns.per_object[:, at[:, None], station.objects] = shown
        columns.touching[:, at] = columns.saturated[:, at] = saturated
        columns.unresolved[:, at] = unresolved
        columns.increase[:, at] = np.where(saturated, np.inf, increases)
        columns.error[:, at] = np.where(saturated | unresolved, np.nan, errors)
        columns.capacitance[:, at] = np.where(saturated, np.inf, capacitance + stray)
        voltage = output_voltages(
            matrix, to_back, coupling, stray, supply, saturated, self._together, station.has_back and station.driven
        )
        columns.output_voltage[:, at] = voltage
        columns.delta_output[:, at] = supply - voltage


def _outlines(bodies: Sequence[ConductorBody], T: Floats) -> Floats:
    """Return corners of boxes around bodies (n, 8 bodies, 3) [m] in poses (n, bodies, 4, 4)."""
    boxes = np.stack([_box(np.concatenate([shape.reshape(-1, 3) for shape in body.shapes])) for body in bodies])
    return np.asarray(transforms.apply(T[:, :, None], boxes)).reshape(len(T), -1, 3)


def _box(points: Floats) -> Floats:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
