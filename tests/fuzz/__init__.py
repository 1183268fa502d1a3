"""All that is read, damaged at random with its checksums made right: refused in a line or read, within bounds."""
