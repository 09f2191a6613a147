"""Recordings: the topics of the contract as they were on the wire, in MCAP files that rosbag2 and Foxglove read."""
