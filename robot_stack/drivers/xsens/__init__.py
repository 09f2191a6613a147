"""Inertial units of Xsens (Movella) on a serial line: the Xbus protocol with MTData2."""
