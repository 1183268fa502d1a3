"""Linkages of free links, one shape each."""

import importlib.util
from pathlib import Path

import numpy as np

from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.mesh import load_mesh
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms


def free_links(count):
    """Return a linkage of `count` links that float in the world, named l000, l001, ..."""
    joints = [Joint(f"j{k:03}", JointType.FREE) for k in range(count)]
    return Linkage([Link(f"l{k:03}", None, np.identity(4), joint) for k, joint in enumerate(joints)])


def pipeline(solids, **options):
    """Return (pipeline, linkage) of solids on free links, all pairs."""
    linkage = free_links(len(solids))
    bodies = [CollisionBody(f"l{k:03}/s", k, solid) for k, solid in enumerate(solids)]
    return CollisionPipeline(bodies, plan_pairs(bodies, linkage), linkage, **options), linkage


def run(solids, poses, **options):
    """Return the columns of solids at poses (n, bodies, 4, 4)."""
    engine, linkage = pipeline(solids, **options)
    return engine.run(linkage.forward(np.zeros((len(poses), 0)), poses))


def phantom():
    """Return the 1 000-triangle human of pyskindose, centred on its box."""
    package = Path(importlib.util.find_spec("pyskindose").origin).parent
    solid = load_mesh(package / "phantom_data/adult_male_reduced_1000t.stl", scale=0.01)
    middle = 0.5 * (solid.vertices.min(axis=0) + solid.vertices.max(axis=0))
    return solid.transformed(transforms.from_translation(-middle))
