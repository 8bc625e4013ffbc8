"""All generated pages; `build.py` puts them beside the pages written by hand."""

from fullam_book import api, commands, equations, figures, schemas, settings


def chapters() -> dict[str, str]:
    """Markdown of the generated pages by path, without suffix, from the book's root."""
    pages: dict[str, str] = {}
    for source in (schemas, settings, equations, commands, figures, api):
        for name, text in source.pages().items():
            assert name not in pages, name
            pages[name] = text
    return pages
