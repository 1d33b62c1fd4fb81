"""Dampers in time: the two cases of the paper (doi:10.1007/s11071-016-3239-6), its loop, and exact
integration of the coupled system.
"""
