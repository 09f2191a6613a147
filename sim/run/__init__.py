"""Runs of a simulation: its pace, scenarios, rides, and their logs."""
