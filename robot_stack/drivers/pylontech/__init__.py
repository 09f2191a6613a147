"""Batteries with Pylontech's CAN protocol for inverters, which many other vendors use too."""
