"""What every part of the YAML language shares: parts, names, places, and quantities with their units."""

from replay import submodules

__getattr__ = submodules(__name__)
