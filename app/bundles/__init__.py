"""Campaign bundles: export of a campaign as one file, and import into another installation with every number
unchanged."""
