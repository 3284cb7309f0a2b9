"""Parts of ``convert`` that write motions and characters."""
