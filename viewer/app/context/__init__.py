"""Context menus: actions on what a right click in the view hits."""
