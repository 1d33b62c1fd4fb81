"""Dampers in time: the paper's two cases, its loop, exact integration of the coupled system, where
methods fail.
"""
