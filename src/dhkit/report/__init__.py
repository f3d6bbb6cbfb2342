"""The article that a course asks for: a robot written up as PDF, HTML or LaTeX.

``document`` has documents as values and their printers, ``sections`` what a report says of a robot, ``article`` puts
them together and keeps them within the course's pages.
"""

from dhkit.report.article import FORMATS, Report, article, write_report

__all__ = ["FORMATS", "Report", "article", "write_report"]
