"""Linkage and scripted motion: scripts to joint positions to link poses, all frames at once."""

from replay import submodules

__getattr__ = submodules(__name__)
