"""Campaign reports: one HTML file that needs neither this program nor a network, and the same as PDF."""
