"""Differential drive: two wheels on two velocity axes."""
