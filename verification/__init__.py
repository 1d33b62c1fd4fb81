"""What judges bladefem: the paper claim by claim. It imports bladefem, never the other way
round.
"""
