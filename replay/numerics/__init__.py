"""Numbers: the jit policy, tolerances with reasons, rigid transforms in batch, closed-form integrals."""

from replay import submodules

__getattr__ = submodules(__name__)
