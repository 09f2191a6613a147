"""Drivers of real devices: convert device data, or another vendor's driver, to the contract's topics."""
