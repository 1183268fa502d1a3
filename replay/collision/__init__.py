"""Pairs, broad phase, GJK and the pipeline that finds level and clearance of every pair."""

from replay import submodules

__getattr__ = submodules(__name__)
