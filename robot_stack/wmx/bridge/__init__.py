"""The engine bridge: a C++ process that serves the vendor's library by the protocol of the simulated engine.

``generate`` makes its tables from the port's; docs/wmx_vendor.md describes how it is built and started.
"""
