"""Shapes as triangles and convex pieces, bounding volumes, and the triangle tree."""

from replay import submodules

__getattr__ = submodules(__name__)
