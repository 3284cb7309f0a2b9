"""Spring joints, such as those of hair and skirts, which lag behind the motion of other joints."""
