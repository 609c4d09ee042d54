"""The same maps taken from a high-poly surface."""
