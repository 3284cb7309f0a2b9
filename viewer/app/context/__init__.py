"""Context menus: actions on the item under a right click in the view."""
