"""Speed against error: every method and every installed peer on the same inputs, in one run."""
