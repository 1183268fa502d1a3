"""Frame blocks to MCAP and rerun recordings, and recordings back to columns."""
