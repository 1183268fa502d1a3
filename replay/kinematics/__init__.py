"""Linkage and scripted motion: scripts to joint positions to link poses, all frames at once."""
