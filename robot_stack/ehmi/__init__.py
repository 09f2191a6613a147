"""The external display (eHMI): its pattern for each state, its line protocol, and its node."""
