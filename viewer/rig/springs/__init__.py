"""Joints that swing behind the motion of others, such as hair and skirts."""
