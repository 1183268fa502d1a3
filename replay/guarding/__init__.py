"""Rules from readings to the clocks of joints: guards that slow and stop the scripted motion."""
