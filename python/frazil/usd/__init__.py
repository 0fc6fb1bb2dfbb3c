"""USD stages as scenes."""
