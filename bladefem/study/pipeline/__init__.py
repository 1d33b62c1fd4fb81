"""From a scene to forced responses, stage by stage."""
