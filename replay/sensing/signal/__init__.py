"""What electronics make of a sensor's ideal reading: filter, samples, noise, gaps, range, steps, delay."""
