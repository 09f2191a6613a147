"""The external display (eHMI): what it shows for each state, its line protocol, and the node that speaks it."""
