"""Drivers of real devices, byte by byte."""
