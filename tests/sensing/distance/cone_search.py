"""The closest point of a triangle in a cone by search: bisection and golden section on membership, no closed form.

Membership is f(x) = (v · x) sin h - |v × x| cos h >= 0. Up to 180 deg f is concave, so along a line its maximum and its
two zeros are found by bisection, and over the lines from one corner to the opposite edge the largest f and the smallest
distance are unimodal. Above 180 deg the closest point q of the triangle is in the cone, or every line from q leaves the
forbidden cone once (it is convex) while the distance grows: the search is over the directions from q.
"""

import math

import numba
import numpy as np

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
GRID = 32
DIRECTIONS = 240


@numba.njit(cache=True)
def membership(x, v, h):
    px = v[1] * x[2] - v[2] * x[1]
    py = v[2] * x[0] - v[0] * x[2]
    pz = v[0] * x[1] - v[1] * x[0]
    along = v[0] * x[0] + v[1] * x[1] + v[2] * x[2]
    return along * math.sin(h) - math.sqrt(px * px + py * py + pz * pz) * math.cos(h)


@numba.njit(cache=True)
def on_line(a, b, t, x):
    for i in range(3):
        x[i] = a[i] + t * (b[i] - a[i]) if t <= 0.5 else b[i] + (1.0 - t) * (a[i] - b[i])


@numba.njit(cache=True)
def slope(a, b, x, v, h):
    """Sign of df/dt on the line a b at x."""
    e = b - a
    cx, cy, cz = v[1] * x[2] - v[2] * x[1], v[2] * x[0] - v[0] * x[2], v[0] * x[1] - v[1] * x[0]
    dx, dy, dz = v[1] * e[2] - v[2] * e[1], v[2] * e[0] - v[0] * e[2], v[0] * e[1] - v[1] * e[0]
    length = math.sqrt(cx * cx + cy * cy + cz * cz)
    change = (v[0] * e[0] + v[1] * e[1] + v[2] * e[2]) * math.sin(h) * length
    return change - (cx * dx + cy * dy + cz * dz) * math.cos(h)


@numba.njit(cache=True)
def highest(a, b, v, h, x):
    """Place t of the largest f on a segment, and that f."""
    low, high = 0.0, 1.0
    for _ in range(60):
        t = 0.5 * (low + high)
        on_line(a, b, t, x)
        if slope(a, b, x, v, h) > 0.0:
            low = t
        else:
            high = t
    best, place = -np.inf, 0.0
    for t in (0.0, 0.5 * (low + high), 1.0):
        on_line(a, b, t, x)
        f = membership(x, v, h)
        if f > best:
            best, place = f, t
    return place, best


@numba.njit(cache=True)
def border(a, b, inside, outside, v, h, x):
    """Last place inside, going from a place inside to one outside; `outside` itself when it is inside."""
    on_line(a, b, outside, x)
    if membership(x, v, h) >= 0.0:
        return outside
    for _ in range(60):
        t = 0.5 * (inside + outside)
        on_line(a, b, t, x)
        if membership(x, v, h) >= 0.0:
            inside = t
        else:
            outside = t
    return inside


@numba.njit(cache=True)
def closest_on_line(a, b, low, high, x):
    """Place t in [low, high] nearest to the origin, by bisection on the sign of x · e."""
    e = b - a
    for _ in range(64):
        t = 0.5 * (low + high)
        on_line(a, b, t, x)
        if x[0] * e[0] + x[1] * e[1] + x[2] * e[2] < 0.0:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@numba.njit(cache=True)
def segment_distance(a, b, v, h, x):
    """Smallest distance on a segment in the cone, inf when none; needs h <= 90 deg."""
    place, f = highest(a, b, v, h, x)
    if f < 0.0:
        return np.inf
    low = border(a, b, place, 0.0, v, h, x)
    high = border(a, b, place, 1.0, v, h, x)
    on_line(a, b, closest_on_line(a, b, low, high, x), x)
    return math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@numba.njit(cache=True)
def fan(corners, s, what, v, h, x, p):
    """Value of the line from the first corner to the place s of the opposite edge: -f (0) or the distance (1)."""
    on_line(corners[1], corners[2], s, p)
    if what == 0:
        return -highest(corners[0], p, v, h, x)[1]
    if what == 1:
        return segment_distance(corners[0], p, v, h, x)
    on_line(corners[0], p, closest_on_line(corners[0], p, 0.0, 1.0, x), x)
    return math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@numba.njit(cache=True)
def lowest(corners, low, high, what, v, h, x, p):
    """Place and value of the lowest fan value in [low, high]: a grid, then golden section about its best place."""
    best, place = np.inf, low
    for i in range(GRID + 1):
        s = low + (high - low) * i / GRID
        value = fan(corners, s, what, v, h, x, p)
        if value < best:
            best, place = value, s
    step = (high - low) / GRID
    a, b = max(low, place - step), min(high, place + step)
    s1, s2 = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    f1, f2 = fan(corners, s1, what, v, h, x, p), fan(corners, s2, what, v, h, x, p)
    for _ in range(75):
        if f1 < best:
            best, place = f1, s1
        if f2 < best:
            best, place = f2, s2
        if f1 < f2:
            b, s2, f2 = s2, s1, f1
            s1 = b - GOLDEN * (b - a)
            f1 = fan(corners, s1, what, v, h, x, p)
        else:
            a, s1, f1 = s1, s2, f2
            s2 = a + GOLDEN * (b - a)
            f2 = fan(corners, s2, what, v, h, x, p)
    return place, best


@numba.njit(cache=True)
def convex_search(triangle, v, h):
    """Return (distance or inf, largest f on the triangle) for h <= 90 deg."""
    x, p = np.empty(3), np.empty(3)
    worst = 0
    for i in range(3):
        if membership(triangle[i], v, h) < membership(triangle[worst], v, h):
            worst = i
    corners = np.empty((3, 3))
    for i in range(3):
        corners[i] = triangle[(worst + i) % 3]
    place, value = lowest(corners, 0.0, 1.0, 0, v, h, x, p)
    if value > 0.0:
        return np.inf, -value
    ends = np.empty(2)
    for side in range(2):
        inside, outside = place, float(side)
        if fan(corners, outside, 0, v, h, x, p) <= 0.0:
            inside = outside
        else:
            for _ in range(60):
                s = 0.5 * (inside + outside)
                if fan(corners, s, 0, v, h, x, p) <= 0.0:
                    inside = s
                else:
                    outside = s
        ends[side] = inside
    return lowest(corners, ends[0], ends[1], 1, v, h, x, p)[1], -value


@numba.njit(cache=True)
def leaving_distance(triangle, q, s, v, h, x, p):
    """Distance where the line from q to the place s (0..3) of the triangle's rim enters the cone, inf when nowhere."""
    edge = min(2, int(s))
    on_line(triangle[edge], triangle[(edge + 1) % 3], s - edge, p)
    if membership(p, v, h) < 0.0:
        return np.inf
    inside, outside = 1.0, 0.0
    for _ in range(60):
        t = 0.5 * (inside + outside)
        on_line(q, p, t, x)
        if membership(x, v, h) >= 0.0:
            inside = t
        else:
            outside = t
    on_line(q, p, inside, x)
    return math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@numba.njit(cache=True)
def reflex_search(triangle, v, h):
    """Return (distance or inf, largest f) for h > 90 deg, where f is convex and largest on a corner."""
    x, p, q = np.empty(3), np.empty(3), np.empty(3)
    corner = -np.inf
    for i in range(3):
        corner = max(corner, membership(triangle[i], v, h))
    place, value = lowest(triangle, 0.0, 1.0, 2, v, h, x, p)
    fan(triangle, place, 2, v, h, x, p)
    q[:] = x
    if membership(q, v, h) >= 0.0:
        return value, max(corner, membership(q, v, h))
    best = np.inf
    values = np.empty(3 * DIRECTIONS + 1)
    for i in range(3 * DIRECTIONS + 1):
        values[i] = leaving_distance(triangle, q, i / DIRECTIONS, v, h, x, p)
        best = min(best, values[i])
    for i in range(3 * DIRECTIONS + 1):
        before, after = max(i - 1, 0), min(i + 1, 3 * DIRECTIONS)
        if values[i] == np.inf or values[i] > values[before] or values[i] > values[after]:
            continue
        a, b = before / DIRECTIONS, after / DIRECTIONS
        for edge_side in range(2):
            low, high = (a, i / DIRECTIONS) if edge_side == 0 else (i / DIRECTIONS, b)
            best = min(best, _refined(triangle, q, low, high, values[i], v, h, x, p))
    # Corners and the places where the rim enters the cone
    for edge in range(3):
        a, b = triangle[edge], triangle[(edge + 1) % 3]
        for first, second in ((a, b), (b, a)):
            if membership(first, v, h) < 0.0:
                continue
            best = min(best, math.sqrt(first[0] ** 2 + first[1] ** 2 + first[2] ** 2))
            on_line(first, second, 1.0, x)
            if membership(x, v, h) >= 0.0:
                low = _dip(first, second, v, h, x)
                if low < 0.0:
                    continue
            else:
                low = 1.0
            inside, outside = 0.0, low
            for _ in range(60):
                t = 0.5 * (inside + outside)
                on_line(first, second, t, x)
                if membership(x, v, h) >= 0.0:
                    inside = t
                else:
                    outside = t
            on_line(first, second, closest_on_line(first, second, 0.0, inside, x), x)
            best = min(best, math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2))
    return best, corner


@numba.njit(cache=True)
def _dip(a, b, v, h, x):
    """A place of the segment outside the cone, where f (convex here) is lowest; -1 when there is none."""
    low, high = 0.0, 1.0
    for _ in range(60):
        t = 0.5 * (low + high)
        on_line(a, b, t, x)
        if slope(a, b, x, v, h) < 0.0:
            low = t
        else:
            high = t
    on_line(a, b, low, x)
    return low if membership(x, v, h) < 0.0 else -1.0


@numba.njit(cache=True)
def _refined(triangle, q, a, b, best, v, h, x, p):
    s1, s2 = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    f1, f2 = leaving_distance(triangle, q, s1, v, h, x, p), leaving_distance(triangle, q, s2, v, h, x, p)
    for _ in range(75):
        best = min(best, f1, f2)
        if f1 < f2:
            b, s2, f2 = s2, s1, f1
            s1 = b - GOLDEN * (b - a)
            f1 = leaving_distance(triangle, q, s1, v, h, x, p)
        else:
            a, s1, f1 = s1, s2, f2
            s2 = a + GOLDEN * (b - a)
            f2 = leaving_distance(triangle, q, s2, v, h, x, p)
    return best


@numba.njit(cache=True)
def search_all(triangles, axes, apertures):
    """Return (distances or inf, largest f) of n triangles given relative to the apex, unit axes."""
    n = len(apertures)
    distances, largest = np.empty(n), np.empty(n)
    for i in range(n):
        h = 0.5 * apertures[i]
        if h <= 0.5 * math.pi:
            distances[i], largest[i] = convex_search(triangles[i], axes[i], h)
        else:
            distances[i], largest[i] = reflex_search(triangles[i], axes[i], h)
    return distances, largest
