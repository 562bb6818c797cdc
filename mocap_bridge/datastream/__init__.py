"""Codec of the Vicon DataStream (CGStream) protocol: bytes to objects and back, no sockets."""
