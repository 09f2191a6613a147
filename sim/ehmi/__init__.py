"""The firmware's side of the external display: a state machine behind the real line protocol, on a pseudo terminal."""
