"""Descriptions of robots (URDF, SRDF, MJCF) to parts that scenarios include; `replay import` alone calls it."""
