"""A recording beside a log of the real machine: time, values, verdict, reports."""
