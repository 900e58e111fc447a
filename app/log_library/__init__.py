"""Analyses of flight logs: gains for a vehicle without a campaign."""
