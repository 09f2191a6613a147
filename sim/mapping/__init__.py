"""The ride for building a map, and the map's accuracy."""
