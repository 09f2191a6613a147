"""Ouster LiDARs (OS-0, OS-1, OS-2, OS-Dome) by their UDP packets and their metadata."""
