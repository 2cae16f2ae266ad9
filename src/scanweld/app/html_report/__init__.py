"""``report.html``: a run's outcome as one page that opens anywhere, without the network."""

from scanweld.app.html_report.write import write_html_report

__all__ = ["write_html_report"]
