"""Two recordings and rules in, their difference by meaning out: text, JSON, HTML, JUnit, rerun overlay."""

from replay import submodules

__getattr__ = submodules(__name__)
