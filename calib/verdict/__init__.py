"""Judge cameras: sigmas, verdicts, report, overlay."""
