"""Sensors: a folder for each kind, and in `kind` what a kind is to the other rooms."""

from replay import submodules

__getattr__ = submodules(__name__)
