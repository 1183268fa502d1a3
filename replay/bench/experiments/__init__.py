"""The thesis's experiments I to IV, splitting, fits and predictions; V and VI, neighbours and a person's earth."""
