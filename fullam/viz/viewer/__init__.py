"""The three-dimensional viewer: live flights, replays, pages, pictures, sliders."""
