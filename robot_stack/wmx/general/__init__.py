"""The general node's rules: what it publishes of the axes, what it lets through to the engine, what it answers."""
