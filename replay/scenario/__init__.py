"""YAML text to a validated Scenario, and a Scenario to a Scene ready to simulate."""
