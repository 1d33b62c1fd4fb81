"""Scenes of mistuned wheels: from one sector and a pattern to the response of every blade."""
