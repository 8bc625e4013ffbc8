"""What one sees: figures and the three-dimensional viewer. Imports are lazy on purpose."""
