"""Meshes that others made, of the packages that have some and are installed: read, told and sensed as they are.

Against trimesh after its own cleaning (bounds, area, volume, closedness), and against brute force (inside, cones and
plates). PACKAGES are from PyPI and none of them is needed but pyskindose; install with `pip install --no-deps`.
"""

import importlib.metadata
import io
import zlib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from replay.errors import MeshError
from replay.geometry.containment import contains
from replay.geometry.mesh import load_mesh
from replay.geometry.mesh_file import FORMATS
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms
from replay.sensing.capacitive import CapacitiveSuite
from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate
from replay.sensing.distance import DistanceSensor, DistanceSuite
from replay.sensing.target import make_target
from tests import brute_force

pytestmark = pytest.mark.compiled  # meshes of thousands of triangles

PACKAGES = (
    "pyskindose",
    "example-robot-data",
    "airo-models",
    "gymnasium-robotics",
    "metaworld",
    "pybullet",
    "pymeshfix",
    "pymeshlab",
    "pyvista",
    "robosuite",
    "rtb-data",
    "safety-gymnasium",
)


def meshes(package):
    """The mesh files of an installed package; none if it is not there."""
    try:
        files = importlib.metadata.distribution(package).files or []
    except importlib.metadata.PackageNotFoundError:
        return []
    return sorted(Path(file.locate()) for file in files if file.suffix.lower() in FORMATS)


def as_trimesh_has_it(path, data):
    """The mesh as trimesh reads it, and cleaned: equal corners merged whatever their normals and textures, flat and
    repeated triangles dropped."""
    read = trimesh.load_scene(io.BytesIO(data), file_type=path.suffix[1:].lower(), process=False).to_mesh()
    cleaned = trimesh.Trimesh(read.vertices, read.faces, process=False)
    cleaned.merge_vertices(merge_tex=True, merge_norm=True)
    cleaned.update_faces(cleaned.nondegenerate_faces(height=1e-15 * cleaned.scale))
    cleaned.update_faces(cleaned.unique_faces())
    return read.triangles, cleaned


def polygons(data):
    """The polygons of an OBJ file as corners (k, 3)."""
    lines = [line.split() for line in data.decode(errors="replace").splitlines()]
    points = np.array([line[1:4] for line in lines if line[:1] == ["v"]], dtype=float)
    numbers = [[int(corner.split("/")[0]) for corner in line[1:]] for line in lines if line[:1] == ["f"]]
    return [points[[n - 1 if n > 0 else n for n in polygon]] for polygon in numbers]


def polygons_area(data):
    """The area of an OBJ file's polygons, each as its own vector."""
    seen = [polygon - polygon[0] for polygon in polygons(data)]
    return 0.5 * sum(np.linalg.norm(np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)) for p in seen)


def volume_of_bends(data):
    """How much volume there is between the ways in which an OBJ file's polygons are cut into fans."""
    total = 0.0
    for polygon in (polygon for polygon in polygons(data) if len(polygon) > 3):
        p = polygon - polygon.mean(axis=0)
        fans = [np.roll(p, -k, axis=0) for k in range(len(p))]
        total += np.ptp([np.cross(fan[1:-1], fan[2:]).sum(axis=0) @ fan[0] / 6.0 for fan in fans])
    return total


def area_counted_once(triangles):
    """The area of triangles (n, 3, 3), each over how many of them hold its middle, in its plane."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    twice = np.linalg.norm(normal, axis=1)
    middle = triangles.mean(axis=1)
    flat = 1e-7 * float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    number = np.zeros(len(triangles))
    for corners, n in zip(triangles[twice > 0.0], (normal[twice > 0.0].T / twice[twice > 0.0]).T, strict=True):
        near = np.flatnonzero(np.abs((middle - corners[0]) @ n) < flat)
        edges = np.roll(corners, -1, axis=0) - corners
        held = np.cross(edges[:, None], middle[near] - corners[:, None]) @ n
        number[near[(held > -(flat**2)).all(axis=0)]] += 1
    return 0.5 * float(np.sum(twice / np.maximum(number, 1.0)))


def not_paired(mesh):
    """How many edges have an odd number of triangles."""
    return int(np.count_nonzero(np.bincount(mesh.edges_unique_inverse) % 2))


def told_by(solid):
    return " ".join(solid.notes)


def compared_to_trimesh(path, data, solid):
    """What differs."""
    triangles, cleaned = as_trimesh_has_it(path, data)
    extent = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    for corner, ours, theirs in zip(
        ("lower", "upper"),
        (solid.triangles.min(axis=(0, 1)), solid.triangles.max(axis=(0, 1))),
        (triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))),
        strict=True,
    ):
        if np.abs(ours - theirs).max() > 1e-6 * extent:
            yield f"{corner} bound {ours}, not {theirs}"
    a, b, c = np.moveaxis(solid.triangles, 1, 0)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    # walls that closed bodies share stay twice, and polygons that are bent or not convex have no area of trimesh's fans
    shared = not_paired(trimesh.Trimesh(**trimesh.triangles.to_kwargs(solid.triangles))) < not_paired(cleaned)
    least = min(cleaned.area, polygons_area(data)) if path.suffix.lower() == ".obj" else cleaned.area
    if area < (1 - 1e-6) * least:  # trimesh does not see flat pieces whose two sides are cut by other diagonals
        least = min(least, area_counted_once(triangles))
    if not (1 - 1e-6) * least <= area <= (1 + 1e-6) * cleaned.area and not shared:
        yield f"area {area}, not {least} to {cleaned.area}"
    if cleaned.is_watertight and not solid.watertight:
        yield f"not closed: {told_by(solid)}"
    off = abs(solid.volume - abs(cleaned.volume))
    bent = volume_of_bends(data) if path.suffix.lower() == ".obj" else 0.0
    if cleaned.is_volume and cleaned.body_count == 1 and off > 1e-6 * abs(cleaned.volume) + 1e-12 * extent**3 + bent:
        yield f"volume {solid.volume}, not {cleaned.volume}"


def inside(solid, rng, count=1000):
    """Points that are said to be on the wrong side."""
    low, high = solid.triangles.min(axis=(0, 1)), solid.triangles.max(axis=(0, 1))
    points = rng.uniform(low - 0.05 * (high - low), high + 0.05 * (high - low), (count, 3))
    found = contains(solid.triangles, points, closing=solid.closing if solid.has_inside else None)
    winding = np.abs(brute_force.winding_numbers(solid.triangles, points))
    sure = np.abs(winding - 0.5) > 1e-6
    in_its_box = ((points >= low) & (points <= high)).all(axis=1)
    expected = (winding > 0.5) & in_its_box & solid.has_inside
    wrong = sure & (found != expected)
    if wrong.any():
        yield f"{wrong.sum()} of {count} points: {points[wrong][0]} inside {found[wrong][0]}, w {winding[wrong][0]}"


def places(solid, rng, count):
    """Poses of a sensor before the surface, looking at it more or less, and now and then from within."""
    extent = float(np.ptp(solid.triangles.reshape(-1, 3), axis=0).max())
    poses = transforms.identity(count)
    for pose in poses:
        a, b, c = solid.triangles[rng.integers(len(solid.triangles))]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        z = rng.choice([-1.0, 1.0], p=[0.8, 0.2]) * normal + rng.normal(size=3) * rng.choice([0.05, 0.5])
        z /= np.linalg.norm(z)
        x = np.cross(z, rng.normal(size=3))
        x /= np.linalg.norm(x)
        pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        pose[:3, 3] = (a + b + c) / 3.0 + normal * extent * 10.0 ** rng.uniform(-2.0, 0.0) * rng.choice([1, 1, 1, -1])
    return poses


def poses_of(places):
    """A machine of a body at the origin and a sensor at these places."""
    links = [Link(name, None, transforms.identity(), Joint(name, JointType.FREE)) for name in ("body", "sensor")]
    free = np.stack([transforms.identity(len(places)), places], axis=1)
    return Linkage(links).forward(np.zeros((len(places), 0)), free)


def cones(solid, target, rng, count=12):
    """Distances that are not what brute force finds."""
    extent = float(np.ptp(solid.triangles.reshape(-1, 3), axis=0).max())
    at = places(solid, rng, count)
    for aperture in (0.2, 1.0, 2.5):
        suite = DistanceSuite([DistanceSensor("d", 1, transforms.identity(), aperture)], [target])
        found = suite.run(poses_of(at)).distance[:, 0]
        for pose, distance in zip(at, found, strict=True):
            accuracy = 1e-7 * extent
            least, most = brute_force.nearest_in_cone(
                solid.triangles, pose[:3, 3], pose[:3, 2], 0.5 * aperture, accuracy
            )
            distance = np.inf if np.isnan(distance) else distance
            if not least - 2 * accuracy <= distance <= most + 2 * accuracy:
                yield f"cone of {aperture} rad at {pose[:3, 3]} to {pose[:3, 2]}: {distance}, not {least} to {most}"


def plates(solid, target, rng, count=6):
    """Capacitances that are not what brute force finds."""
    extent = float(np.ptp(solid.triangles.reshape(-1, 3), axis=0).max())
    at = places(solid, rng, count)
    for side in ("front", "both"):
        half = extent * np.array([0.05, 0.02])
        sensor = CapacitiveSensor("c", 1, (Plate("p", transforms.identity(), half),), coupling=1e-10, side=side)
        columns = CapacitiveSuite([sensor], [target]).run(poses_of(at))
        for k, pose in enumerate(at):
            seen = transforms.apply(transforms.invert(pose), solid.triangles)
            grid = np.stack(np.meshgrid(*np.linspace(-half, half, 5).T, 0.0), axis=-1).reshape(-1, 3)
            held = np.abs(brute_force.winding_numbers(seen, grid)) > 0.5
            if not solid.watertight:  # in an opening the inside ends softly: the plate's centre tells
                held = held[len(grid) // 2]
            if columns.touching[k, 0]:
                least = brute_force.nearest_to_plate(seen, half, 1e-4 * extent)
                if least > 2e-4 * extent and not (held.any() and solid.has_inside):
                    yield f"a plate at {pose[:3, 3]} touches, but is {least} away"
                continue
            if held.any() and solid.has_inside:
                yield f"a plate at {pose[:3, 3]} has points inside and is not saturated"
            expected = brute_force.plate_integral(seen, half, side == "both") * sensor.permittivity
            found = columns.capacitance[k, 0]
            if not abs(found - expected) <= 2e-5 * expected + 1e-30:
                yield f"a plate at {pose[:3, 3]}, {side}: {found} F, not {expected}"


def faults(path, rng):
    """What is wrong with how a file is read, and why it is refused, if it is."""
    data = path.read_bytes()
    try:
        solid = load_mesh(path, scale=1.0, data=data)
    except MeshError as error:
        yield f"refused: {error.reason}"
        return
    yield from compared_to_trimesh(path, data, solid)
    yield from inside(solid, rng)
    target = make_target("body/mesh", 0, solid.triangles, closing=solid.closing_of_inside)
    yield from cones(solid, target, rng)
    yield from plates(solid, target, rng)


@pytest.mark.soak
@pytest.mark.parametrize("package", PACKAGES)
def test_every_mesh_of_a_package_is_read_told_and_sensed_as_it_is(package):
    paths = meshes(package)
    if not paths:
        pytest.skip(f"{package} is not installed")
    for path in paths:
        found = list(faults(path, np.random.default_rng(zlib.crc32(path.name.encode()))))
        assert not found, (path, found)


def test_a_phantom_is_read_told_and_sensed_as_it_is():
    (path,) = (path for path in meshes("pyskindose") if path.name == "hudfrid_reduced_1000t.stl")
    assert not list(faults(path, np.random.default_rng(1)))
