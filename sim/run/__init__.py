"""Runs of a simulation: its pace, scenarios, rides, and what is noted of them."""
