"""What the tool picks up: bodies, those that the law knows of, and those that it learns."""
