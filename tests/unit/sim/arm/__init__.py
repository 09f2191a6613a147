"""Tests of the simulated arm."""
