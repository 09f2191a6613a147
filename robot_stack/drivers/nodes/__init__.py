"""One process per driver."""
