"""What writes the book's generated pages: each module turns a part of fullam into Markdown."""
