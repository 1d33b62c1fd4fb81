"""The run folder: stored stages, the codec of arrays, one command at a time in a folder."""
