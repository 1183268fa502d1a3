"""Log files as columns: bytes to arrays per topic, integrity and salvage; knows no scene."""
