"""The atlas of failures: pages, figures, report."""
