"""YAML text to a validated Scenario, and a Scenario to a Scene ready to simulate."""

from replay import submodules

__getattr__ = submodules(__name__)
