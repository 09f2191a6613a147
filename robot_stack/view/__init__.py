"""The live view: the contract's topics for Foxglove and others that speak its websocket protocol."""
