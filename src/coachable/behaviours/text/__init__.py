"""The language: from a text to a behaviour and back, with every error in its place."""

from coachable.behaviours.text.document import Document, formatted_file, read_document
from coachable.behaviours.text.formatter import formatted
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text

__all__ = [
    "Document",
    "formatted",
    "formatted_file",
    "parse",
    "read_document",
    "to_text",
]
