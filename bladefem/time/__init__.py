"""The reduced system in time: exact flow between events, and periodic solutions by shooting."""
