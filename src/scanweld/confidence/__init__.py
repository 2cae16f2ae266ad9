"""Evidence to confidence: how probable it is that a pose is right."""
