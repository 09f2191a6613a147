"""Drivers of real devices: what arrives on a wire, or from another vendor's driver, as the contract's topics."""
