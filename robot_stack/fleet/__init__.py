"""The robot in a fleet: orders, states and actions of VDA 5050 over an MQTT broker."""
