"""The language: from a text to a behaviour and back, with every error in its place."""

from coachable.behaviours.text.document import Document as Document
from coachable.behaviours.text.document import formatted_file as formatted_file
from coachable.behaviours.text.document import read_document as read_document
from coachable.behaviours.text.formatter import formatted as formatted
from coachable.behaviours.text.parser import parse as parse
from coachable.behaviours.text.printer import to_text as to_text
