"""Many scenarios: find and select them, run them, and say what became of each."""
