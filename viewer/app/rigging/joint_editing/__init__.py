"""Editing of joints in the view: placed, dragged, removed, mirrored; weights follow.

The edited actor shows a figure that every edit replaces: its mesh stays, its joints change
(``viewer/rigs/joint_edits.py``). A job then binds the mesh to the new joints, which takes a
fraction of a second: what depends on the mesh alone is kept (``viewer/autorig/binding.py``).
"""
