"""The paper, figure by figure and claim by claim: python -m verification.paper.page."""
