"""The touch screen: a web page for riders and staff, and the node that serves it."""
