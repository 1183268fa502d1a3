"""Pairs, broad phase, GJK and the pipeline that finds level and clearance of every pair."""
