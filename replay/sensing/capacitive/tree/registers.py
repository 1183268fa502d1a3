"""Where each number stands: the columns of all rows and lanes that the tree works with, in one table.

Rows are read by the line of memory and gathered into lanes, where a column must be at a constant place of one array:
over records with named fields, or an array for each column, the same loop takes 1.8 times as long, since the compiler
then has to make sure that they are different memory. So columns have names here instead; one that says "first of" so
many is followed by them.
"""

from __future__ import annotations

import numpy as np

LANES = 64
"""Parts that are judged or summed side by side."""

LINE = 8
"""Numbers in a line of memory."""

# Clusters.nodes; up to MEAN2 Clusters.outlines has the same columns
CENTROID = 0  # first of 3 [m]
RADIUS = 3  # largest distance of a corner from the centroid [m]
AREA = 4  # [m^2]
CORNER5 = 5  # bound of order 5 of the expansion diagonally off the plate [m^5]; in outlines times the area
EDGE5 = 6  # and elsewhere [m^5]; in outlines times the area
MEAN6 = 7  # mean of |d|^6, d from the centroid [m^6]; in outlines times the area
MEAN2 = 8  # mean of |d|^2 [m^2]
NORMAL = 9  # first of 3: axis of a cone around the outward normals
OPENING = 12  # cosine of that cone's half angle; -1: anything may point anywhere
NEAREST_PLANE = 13  # least offset of the triangles' planes from the centroid, along their own normals [m]
FARTHEST_PLANE = 14  # and the largest [m]

# Clusters.outlines, beside those
MIDDLE = 9  # first of 3: middle of the box, from the centroid [m]
HALF = 12  # first of 3: half the box's edges [m]
SIGMA = 15  # largest standard deviation of the points in any direction [m]
OUTLINE_COLUMNS = 16

# Clusters.links
SECOND_CHILD = 0  # or -1; the first child is the next node
BEGIN = 1  # first triangle
END = 2  # and one beyond the last
SECOND_OF_SECOND = 3  # second child of the second child, or -1

# Clusters.triangles, and pieces of triangles
CORNERS = 0  # first of 9 [m]
REACH = 9  # largest distance of a corner from the centroid [m]
SPREAD = 10  # mean of |d|^2 [m^2]
SIZE = 11  # area [m^2]
TRIANGLE_COLUMNS = 16
OWNER = 12  # of a piece: the triangle it was cut from, by its row in what `Pieces` keeps of owners
PIECE_REGION = 13  # of a piece that has its rule: its region
PIECE_SHIFT = 14  # and the correction for borders [m]
PIECE_COLUMNS = 16

# Clusters.moments, means over the area
TERMS = (
    "xx yy zz xy xz yz "
    "xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz "
    "xxxx yyyy zzzz xxyy xxzz yyzz xxxy xxxz yyyx yyyz zzzx zzzy xxyz yyxz zzxy"
)
KEPT = np.array([[term.count(axis) for axis in "xyz"] for term in TERMS.split(" ")])
"""(31, 3) powers of x, y and z of the columns from SECOND on."""
SECOND = 0  # first of 6 [m^2]
THIRD = 6  # first of 10 [m^3]
FOURTH = 16  # first of 15 [m^4]
WHOLE = 31  # area [m^2]
PLACE = 32  # first of 3: the centroid [m]
NUMBER = 35  # of triangles
MOMENT_COLUMNS = 40

# lanes: the first 40 columns hold a row of the above, in the columns it has there
FOUND = 40  # first of what is found of a node or triangle; the same four are Queue.values:
ERROR = 0  # bound of the error [m]
SHIFT = 1  # what its expansion or rule is corrected by [m]
LEAST = 2  # lower bound of its integral [m]
REGION = 3  # the region it is expanded in, see `region_of`
VALUES = 4
VERDICT = 44  # on a node or triangle: DROP, OPEN or KEEP
RULE_FOUND = 45  # a triangle's rule
FIRST_RULE = 46  # the first rule that comes into question
ALLOWED = 47  # the error that a triangle may make [m]
SUM = 49  # sum over a node or triangle [m]
COLUMNS = 52

# Queue.labels
PART = 0  # index of the node or triangle
RULE = 1  # a triangle's rule, CLUSTER or FREE
NEXT = 2  # next slot
LABELS = 3

DROP, OPEN, KEEP = -1, 0, 1
"""Verdicts: nothing of it counts; it must be opened; it can be summed as a whole."""

POINTS_1, POINTS_3, POINTS_7, POINTS_16, NO_RULE = range(5)
"""What a part is summed by. A triangle: by so many points."""

ABOVE = NO_RULE + 1
"""Added to a rule: only the part of the triangle that is above z = 0."""

CLUSTER = NO_RULE
"""A node: by its moments."""

FREE = ABOVE + NO_RULE
"""A slot without a part."""

RULES = FREE + 1
