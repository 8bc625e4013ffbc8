"""What the tool is asked to do, and the motions of platform and arm that do it."""
