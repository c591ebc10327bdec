"""How sure the cameras are: sigmas, verdicts, report, overlay."""
