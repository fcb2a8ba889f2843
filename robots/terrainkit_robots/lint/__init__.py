"""Check robots: rules, findings, reports, fixes and comparisons."""
