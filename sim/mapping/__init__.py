"""The ride that a map is built from, and how true the map is."""
