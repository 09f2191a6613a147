"""The node of the perception pipeline and its helpers."""
