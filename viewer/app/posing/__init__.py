"""Interactive posing: panels for joints, shapes and hands, and the tools in the view."""
