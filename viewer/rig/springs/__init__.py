"""Spring joints, which lag behind the motion of others, such as hair and skirts."""
