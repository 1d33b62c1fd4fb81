"""The whole wheel: N sectors that are not alike, each with its damper, in one balance."""
