"""Frame blocks to MCAP and rerun recordings, and recordings back to columns."""

from replay import submodules

__getattr__ = submodules(__name__)
