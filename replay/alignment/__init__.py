"""Measured signals beside simulated ones: the clock of a log, its samples at frames, how far they are off."""
