"""Replay of a recording: single nodes on the deterministic scheduler, their outputs compared with the recorded ones."""
