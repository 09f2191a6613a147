"""What the optional services of the motion-engine layer do with the engine, and what they answer."""
