"""Messages of the fleet agent and its node."""
