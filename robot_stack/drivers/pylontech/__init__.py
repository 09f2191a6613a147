"""Batteries that speak Pylontech's CAN protocol for inverters, which many others speak too."""
