"""A body's sum with a stated tolerance: far clusters by their moments, near triangles exactly."""
