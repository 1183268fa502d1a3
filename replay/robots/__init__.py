"""Descriptions of robots (URDF, SRDF) to parts that scenarios include; `replay import` alone calls it."""
