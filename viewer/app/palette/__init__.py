"""Command palette: finds and runs every action, panel, joint and figure by name."""
