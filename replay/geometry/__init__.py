"""Shapes as triangles and convex pieces, bounding volumes, and the triangle tree."""
