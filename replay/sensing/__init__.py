"""The distance sensor and the capacitive sensor."""

from replay import submodules

__getattr__ = submodules(__name__)
