"""The localization node and its message conversions."""
