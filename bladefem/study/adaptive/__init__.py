"""Settings of the balance chosen by error indicators."""
