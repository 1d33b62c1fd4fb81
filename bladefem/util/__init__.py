"""Progress bars and names that load on first use."""
