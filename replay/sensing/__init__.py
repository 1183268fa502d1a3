"""The distance sensor and the capacitive sensor."""
