"""Multi-harmonic balance of friction-damped bodies: from numbers and frequencies to certain
responses.
"""
