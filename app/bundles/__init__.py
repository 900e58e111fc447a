"""A campaign as one file: out of one installation, and into another with every number as it was."""
