"""The live view: the contract's topics for Foxglove and other clients of its websocket protocol."""
