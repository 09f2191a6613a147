"""What the mission manager's node is made of beside the node itself."""
