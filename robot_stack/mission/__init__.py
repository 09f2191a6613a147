"""Missions: routes of waypoints driven one after the other on commands of a person."""
