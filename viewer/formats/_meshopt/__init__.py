"""Decoders of the streams and filters of meshoptimizer, which compress buffers of glTF files."""
