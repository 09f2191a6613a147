"""Rules of the general node: its published axis states, its checks of commands, its service responses."""
