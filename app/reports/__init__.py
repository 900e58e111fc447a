"""A campaign on paper: one HTML file that needs neither this program nor a network, and the same as PDF."""
