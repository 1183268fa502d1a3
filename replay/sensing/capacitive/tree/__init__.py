"""A body's sum with a stated tolerance: far clusters by their moments, near triangles exactly.

The tree is opened from the root until every part, a node or a triangle, has an error bound below what is allowed. From
then on, as long as the bounds E add up to more than rtol times a lower bound of the sum, the parts with the most error
per effort are opened, at least as much error as there is too much: a node into its children, a triangle into a rule of
more points, and at last into pieces or the closed form. So the result meets rtol, and the work goes where it pays; what
is small or far away may be relatively worse. The parts are summed at the end; nothing depends on other poses.

To be read in this order:

1. `registers`: where each number stands. `clusters`: what is kept of a body's tree, once; `moments`: how it is found.
2. `tree_sum`: the whole way of one pose and plate. It asks for infinity first, then opens and sums.
3. `opening`: which parts are opened, first of all what is across z = 0, until the `budget` is met; `parts` is the queue
   that they wait in, and the memory for all.
4. `lanes`: nodes, triangles and pieces are judged and summed many side by side. `cluster_bounds` and `triangle_bounds`
   judge: whether one can be summed as it is, and how wrong that may be.
5. `hard_triangles`: what no rule fits is cut; `triangle_pieces`: how.
6. `part_sum`: the parts are summed, clusters by Legendre's expansion, triangles by points.

Bounds. Let r be the distance components of the centroid in its region (u, v, z with the region's zeros), r its length,
h the largest distance of a corner from the centroid, d a point's place about it, x = h/r < 2/3. Inside one region
1/dist = 1/|r + Pd|, P dropping the region's zero components, and by Legendre's expansion

    1/|r + Pd| = sum_k (-1)^k |Pd|^k P_k(cos) / r^(k+1),   |rest after order p| <= |d|^(p+1) / (r^(p+2) (1 - x)).

- A cluster of area A takes orders 0, 2, 3, 4 from its moments (order 1 vanishes at the centroid). Order 5 is a form in
  the mean M5 of d d d d d, so it is at most the product of both Frobenius norms, and at most mean |d|^5. If P drops
  nothing, the form is harmonic, and of M5 only what has no traces counts, |M5|^2 - 10/9 |tr M5|^2 + 5/21 |tr tr M5|^2:
  E = A min(c |M5|, mean |d|^5)/r^6 + A mean |d|^6/(r^6 (r - h)); c^2 = 7.875, else 4.203125 (1 would do if P drops
  two).
- Part of it may lie over a border, by w: there 1/dist is expanded in the wrong region's form, whose squared distance is
  off by 0 to w^2, so the integral by 0 to B = A mean(w^2) / (2 (r - h)^3), of known sign: the sum is corrected by B/2,
  and E += B/2. Let t be a point's place across the border, of mean 0 and variance V, R the largest t and g >= 0 the
  border, w = max(t - g, 0): the parabola (R - g)^2 ((t + V/R)/(R + V/R))^2 is nowhere below w^2 up to R, so mean(w^2)
  <= (R - g)^2 V/(R^2 + V). V is at most the largest variance in any direction, and at most R times the reach to the
  other side (Bhatia and Davis 2000). No cluster is clipped for it. For a triangle mean(w^2) is known; it is off by A
  mean(w^2)/2 times something between 1/(r + h)^3 and 1/(r - h)^3.
- Clusters are judged by outlines of half the digits: a place may be off by `blur`. So r is computed at the place found
  and made smaller by blur, R is made larger by it and g smaller, V + blur^2 is taken for V, and what lies within blur
  of z = 0 is opened. A centroid may then be taken to be on the wrong side of a border: mean(w^2) is at most V + g^2
  there, so blur^2 is added to it. The expansion itself has all digits; it is taken in the region in which the outline
  was judged.
- A triangle: 1 point, E = A spread/(r - h)^3, borders or not, as the Hessian of 1/dist is at most 2/dist^3, spread =
  mean |d|^2; 3 points of degree 2, E = c A h spread/(r^4 (1 - x)); 7 points of degree 5, E = c A h^4 spread/(r^7 (1 -
  x)); 16 points of degree 8, E = c A h^7 spread/(r^10 (1 - x)); c below. The part above z = 0 of one that crosses it
  has 1 point with a bound of its own (`part_above`), or is the small triangle that z = 0 cuts off, or the large one
  less that, each by a rule: across z = 0 1/dist is smooth, but for the plate; and the small one has no corner farther
  from its centroid than 4/3 h, nor a point nearer to the plate than r - h. What no rule fits is cut, see
  `hard_triangles`.
- The mean of 1/dist is at least 1/sqrt(mean dist^2) (Jensen), and mean dist^2 <= r^2 + mean |d|^2 (what is linear in d
  vanishes): a part brings at least A/sqrt(r^2 + mean |d|^2) >= A/r (1 - mean |d|^2/(2 r^2)).

Proven, in exact arithmetic: the rest of the expansion, the norms of order 5, the borders, the blur, the single point,
also above z = 0, and what a part brings at least. Measured and doubled: the three c of the rules of 3, 7 and 16
points (`_RULE_3`, `_RULE_7` and `_RULE_16` in `triangle_bounds`), about twice the largest that a search over shapes,
directions and regions climbs to (test_point_rules). Rounding is in none of them; tests allow it 1e-13 of the sum, and
rtol is 1e-12 at least.
"""
